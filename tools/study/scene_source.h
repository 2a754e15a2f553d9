// What a scene or a sequence follows from, as text: whether a result is still of it.
#pragma once

#include <filesystem>
#include <string>

namespace lumen {

// The scene's text and that of its base, and a digest of every file that it names as its trajectory, wall,
// centreline or mask (or that the file is absent). Throws InputError where the scene can't be read.
std::string SceneSource(const std::filesystem::path& scene);

// Digests of a sequence's texts, and the names and sizes of its other files.
std::string SequenceSource(const std::filesystem::path& folder);

}  // namespace lumen
