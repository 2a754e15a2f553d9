#include "tools/bench_memory.h"

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace lumen {
namespace {

// A line of /proc/self/status in kB, as MB.
double StatusMegabytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key)) return std::stod(line.substr(key.size())) * 1024 / kBytesPerMegabyte;
  }
  throw std::runtime_error("/proc/self/status has no " + key);
}

}  // namespace

double MegabytesBeyondBefore(const std::function<void()>& body) {
  malloc_trim(0);
  // 5: VmHWM starts anew from what is resident (proc(5)).
  if (!(std::ofstream("/proc/self/clear_refs") << "5" << std::flush)) {
    throw std::runtime_error("/proc/self/clear_refs can't be written: the peak of memory can't be measured");
  }
  const double before = StatusMegabytes("VmRSS:");
  body();
  return StatusMegabytes("VmHWM:") - before;
}

double MegabytesOfOtherProcess(const std::vector<std::string>& arguments) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), "lumen_bench_render");
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    close(ends[0]);
    close(ends[1]);
    execv("/proc/self/exe", pointers.data());
    _exit(127);
  }
  close(ends[1]);
  double megabytes = 0;
  FILE* said = fdopen(ends[0], "r");
  const bool read = std::fscanf(said, "%lf", &megabytes) == 1;
  std::fclose(said);
  int status = 0;
  waitpid(child, &status, 0);
  if (child < 0 || !read || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("the measurement of memory in a process of its own failed");
  }
  return megabytes;
}

}  // namespace lumen
