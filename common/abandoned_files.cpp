#include "common/abandoned_files.h"

#include <signal.h>

#include <cerrno>
#include <charconv>
#include <string>
#include <vector>

namespace lumen {
namespace {

namespace fs = std::filesystem;

// The process in ".NAME.PROCESS-COUNT.tmp…", as PendingFile names its files; 0 for other names.
pid_t WriterOf(const std::string& name) {
  const size_t end = name.rfind(".tmp"), dash = name.rfind('-', end);
  if (name[0] != '.' || end == std::string::npos || dash == std::string::npos || dash == 0) return 0;
  const size_t begin = name.rfind('.', dash) + 1;
  pid_t process = 0;
  const auto [stop, error] = std::from_chars(name.data() + begin, name.data() + dash, process);
  return error == std::errc() && stop == name.data() + dash ? process : 0;
}

}  // namespace

void RemoveAbandonedFiles(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const pid_t writer = WriterOf(entry->path().filename().string());
    if (writer > 0 && kill(writer, 0) != 0 && errno == ESRCH) abandoned.push_back(entry->path());
  }
  for (const fs::path& file : abandoned) fs::remove(file, error);
}

}  // namespace lumen
