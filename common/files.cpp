#include "common/files.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#include "common/error.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailWith(const fs::path& path, const char* action, int error_number) {
  throw InputError(path.string() + ": cannot " + action + ": " + std::strerror(error_number));
}

// Devices and pipes ("/dev/stdout") can't be replaced by a rename; they are written in place.
bool WrittenInPlace(const fs::path& target) {
  std::error_code error;
  const fs::file_status status = fs::status(target, error);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

}  // namespace

PendingFile::PendingFile(fs::path target) : target_(std::move(target)), temporary_(target_) {
  if (WrittenInPlace(target_)) return;
  // A link keeps being one: what it points to is replaced.
  std::error_code no_link;
  const fs::path linked = fs::is_symlink(target_, no_link) ? fs::weakly_canonical(target_, no_link) : target_;
  if (!no_link) target_ = linked;
  // Unique among processes and within this one; hidden, so that no reader of the folder takes it for a frame.
  static std::atomic<unsigned> counter = 0;
  std::string name = ".";
  name +=
      target_.stem().string() + "." + std::to_string(getpid()) + "-" + std::to_string(counter.fetch_add(1));
  temporary_ = target_.parent_path() / (name + ".tmp" + target_.extension().string());
}

PendingFile::~PendingFile() {
  if (committed_ || temporary_ == target_) return;
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void PendingFile::Commit() {
  if (temporary_ != target_) {
    std::error_code error;
    fs::rename(temporary_, target_, error);
    if (error) FailWith(target_, "write", error.value());
  }
  committed_ = true;
}

void WriteFile(const fs::path& path, std::string_view bytes) {
  PendingFile pending(path);
  std::FILE* file = std::fopen(pending.path().c_str(), "wb");
  if (!file) FailWith(path, "write", errno);
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  const int write_error = errno;
  const bool closed = std::fclose(file) == 0;
  if (!written || !closed) FailWith(path, "write", written ? errno : write_error);
  pending.Commit();
}

std::string ReadFile(const fs::path& path) {
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (!file) FailWith(path, "read", errno);
  std::string bytes;
  char buffer[1 << 16];
  size_t count;
  while ((count = std::fread(buffer, 1, sizeof buffer, file)) > 0) bytes.append(buffer, count);
  const int read_error = std::ferror(file) ? errno : 0;
  std::fclose(file);
  if (read_error) FailWith(path, "read", read_error);
  return bytes;
}

void CreateFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) FailWith(folder, "create this folder", error.value());
  if (!fs::is_directory(folder, error)) FailWith(folder, "create this folder", ENOTDIR);
}

}  // namespace lumen
