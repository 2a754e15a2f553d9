// Files that are whole or absent: everything is written to a temporary name beside its target and renamed.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace lumen {

// The temporary name under which a file is written, with the target's extension (writers choose their format
// by it). Commit() renames it to the target; without it the destructor removes the temporary.
class PendingFile {
 public:
  explicit PendingFile(std::filesystem::path target);
  ~PendingFile();
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  const std::filesystem::path& path() const { return temporary_; }
  // Throws InputError (disk full, folder not writable, …).
  void Commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  bool committed_ = false;
};

// Writes bytes to a file, whole or not at all. Throws InputError naming the file and the system's reason.
void WriteFile(const std::filesystem::path& path, std::string_view bytes);

// The whole content of a file. Throws InputError naming the file and the system's reason.
std::string ReadFile(const std::filesystem::path& path);

// Creates a folder and its parents. Throws InputError.
void CreateFolder(const std::filesystem::path& folder);

}  // namespace lumen
