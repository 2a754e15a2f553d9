// The command as a process of its own, which a test may kill.
#pragma once

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace lumen::test {

// Starts `lumen` with these words. said: file for what it says on stderr; none: said on the test's own.
// largest_file: bytes beyond which its writes fail, as on a full disk.
inline pid_t StartLumen(std::vector<std::string> words, const std::filesystem::path& said = {},
                        rlim_t largest_file = RLIM_INFINITY) {
  words.insert(words.begin(), "lumen");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const std::string errors = said.string();
  const pid_t child = fork();
  if (child == 0) {
    if (!freopen("/dev/null", "w", stdout)) _exit(3);
    if (!errors.empty() && !freopen(errors.c_str(), "w", stderr)) _exit(3);
    const rlimit limit = {largest_file, largest_file};
    signal(SIGXFSZ, SIG_IGN);  // a write then fails
    setrlimit(RLIMIT_FSIZE, &limit);
    execv(LUMEN_COMMAND, arguments.data());
    _exit(3);
  }
  return child;
}

// Waits for its end; −1 if a signal ended it.
inline int ExitCode(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace lumen::test
