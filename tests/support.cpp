#include "tests/support.h"

#include <stdlib.h>

namespace lumen::test {

std::filesystem::path SharedData(const std::string& relative) {
  const char* folder = std::getenv("LUMEN_DATA");
  return std::filesystem::path(folder ? folder : LUMEN_SOURCE_FOLDER "/../shared/data") / relative;
}

ScratchFolder::ScratchFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "lumen-test-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw std::runtime_error("no scratch folder: " + pattern);
  path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace lumen::test
