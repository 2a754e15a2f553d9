// What several tests need: the data folder, scratch folders.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "common/error.h"

namespace lumen::test {

// A file or folder of the shared data (real frame, trajectories, CT colon), which is not part of the project.
// LUMEN_DATA names the folder; otherwise it is looked for beside the checkout (../shared/data).
std::filesystem::path SharedData(const std::string& relative);

// Skips a test, saying why, where the shared data is absent.
#define LUMEN_NEEDS_DATA(relative)                      \
  if (!std::filesystem::exists(SharedData(relative))) { \
    GTEST_SKIP() << "no " << SharedData(relative);      \
  }

// The message of the InputError that the body throws; empty where it throws none.
template <class Body>
std::string ErrorOf(const Body& body) {
  try {
    body();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// An empty folder of the test's own, removed at the end of the scope.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace lumen::test
