#include "tools/study/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "common/config.h"
#include "common/files.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// FNV-1a, 64 bits (Fowler, Noll, Vo): for telling files apart, not against ill will.
uint64_t Digest(const std::string& bytes) {
  uint64_t digest = 14695981039346656037ull;
  for (const char byte : bytes) digest = (digest ^ static_cast<unsigned char>(byte)) * 1099511628211ull;
  return digest;
}

std::string DigestOf(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return file.string() + ": absent\n";
  return fmt::format("{}: {:016x}\n", file.string(), Digest(ReadFile(file)));
}

}  // namespace

std::string SceneSource(const fs::path& scene) {
  std::string source = ReadFile(scene);
  const Config own = Config::Read(scene);
  if (own.root().Has("base")) source += ReadFile(own.root().Path("base"));
  const Config config = Config::ReadWithBase(scene);
  const std::pair<const char*, const char*> files[] = {
      {"trajectory", "path"}, {"geometry", "path"}, {"geometry", "centreline"}, {"camera", "mask"}};
  for (const auto& [table, key] : files) {
    const auto found = config.root().Optional(table);
    if (found && found->Has(key)) source += DigestOf(found->Path(key));
  }
  return source;
}

std::string SequenceSource(const fs::path& folder) {
  std::vector<std::string> lines;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || entry.path().filename().string().starts_with('.')) continue;
    const std::string extension = entry.path().extension().string();
    const bool small = extension == ".txt" || extension == ".toml";
    lines.push_back(small ? DigestOf(entry.path())
                          : fmt::format("{}: {} bytes\n", entry.path().string(), entry.file_size()));
  }
  std::ranges::sort(lines);
  std::string source;
  for (const std::string& line : lines) source += line;
  return source;
}

}  // namespace lumen
