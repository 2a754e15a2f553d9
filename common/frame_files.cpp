#include "common/frame_files.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <vector>

#include "common/error.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// What a kind of file is called, in a folder for all (v1) and in one of its own (v2).
struct Kind {
  fs::path FrameFiles::*member;
  std::string suffix;     // NNNN_suffix
  std::string subfolder;  // of C3VDv2
  std::vector<std::string> extensions;
};

const std::vector<Kind>& Kinds() {
  static const std::vector<Kind> kinds = {
      {&FrameFiles::color, "color", "rgb", {".png"}},
      {&FrameFiles::depth, "depth", "depth", {".tiff", ".tif"}},
      {&FrameFiles::normals, "normals", "normals", {".tiff", ".tif"}},
      {&FrameFiles::flow, "flow", "optical_flow", {".tiff", ".tif"}},
      {&FrameFiles::occlusion, "occlusion", "occlusions", {".png"}},
  };
  return kinds;
}

// The number that a name starts with and what follows it.
std::optional<int> LeadingNumber(const std::string& stem, std::string* rest) {
  int number = 0;
  const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
  if (error != std::errc() || number < 0 || stem[0] == '-') return std::nullopt;
  *rest = std::string(end, stem.data() + stem.size());
  return number;
}

// The first number anywhere in a name.
std::optional<int> AnyNumber(const std::string& stem) {
  const size_t first = stem.find_first_of("0123456789");
  std::string rest;
  return first == std::string::npos ? std::nullopt : LeadingNumber(stem.substr(first), &rest);
}

void Claim(std::map<int, FrameFiles>* frames, int number, const Kind& kind, const fs::path& file) {
  fs::path& place = (*frames)[number].*kind.member;
  if (!place.empty()) {
    throw InputError(file.string() + ": frame " + std::to_string(number) + " already has " + place.string() +
                     "; remove one of them");
  }
  place = file;
}

bool HasExtension(const Kind& kind, const fs::path& file) {
  return std::ranges::find(kind.extensions, file.extension().string()) != kind.extensions.end();
}

// In alphabetical order, so that messages don't depend on the file system. Hidden files are unfinished ones.
std::vector<fs::path> FilesOf(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (!entry->path().filename().string().starts_with('.')) files.push_back(entry->path());
  }
  if (error) throw InputError(folder.string() + ": cannot be listed: " + error.message());
  std::ranges::sort(files);
  return files;
}

}  // namespace

std::map<int, FrameFiles> FindFrameFiles(const fs::path& folder) {
  std::map<int, FrameFiles> frames;
  for (const fs::path& file : FilesOf(folder)) {
    std::string rest;
    const auto number = LeadingNumber(file.stem().string(), &rest);
    for (const Kind& kind : Kinds()) {
      if (number && rest == "_" + kind.suffix && HasExtension(kind, file))
        Claim(&frames, *number, kind, file);
    }
  }
  for (const Kind& kind : Kinds()) {
    std::error_code ignored;
    if (!fs::is_directory(folder / kind.subfolder, ignored)) continue;
    for (const fs::path& file : FilesOf(folder / kind.subfolder)) {
      const auto number = AnyNumber(file.stem().string());
      if (number && HasExtension(kind, file)) Claim(&frames, *number, kind, file);
    }
  }
  return frames;
}

}  // namespace lumen
