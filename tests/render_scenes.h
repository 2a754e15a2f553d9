// A small scene that renders in a moment, for the tests of scenes and of rendering.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/files.h"
#include "common/image.h"
#include "tests/support.h"

namespace lumen::test {

// A short, coarse colon, three frames of 60×48 pixels, every effect on.
inline constexpr const char* kSmallScene = R"([geometry]
kind = "colon"
length_mm = 40
bend_rad = 0.2
tolerance_mm = 0.3

[trajectory]
kind = "withdrawal"
start_mm = 24
end_mm = 14
frames = 3

[camera]
preset = "c3vd"
width = 60
height = 48
mask = "octagon"

[light]
model = "sls"
calibrated = true
[[light.source]]
position = [3.24, 0.55, 0]
direction = [0, 0, 1]
spread = 2
intensity = [1500, 1500, 1500]
[[light.source]]
position = [0, 0, 0]
direction = [0, 0, 1]
spread = 2.77
intensity = [600, 600, 600]

[response]
gamma = 2.2
vignetting = 1.5

[surface]
albedo = [0.7, 0.4, 0.3]
[surface.mottling]
[surface.vessels]

[path]
samples = 3
bounces = 2

[sensor.auto_gain]

[truth]
)";

inline std::filesystem::path WriteScene(const ScratchFolder& scratch, const std::string& text = kSmallScene) {
  const std::filesystem::path file = scratch / "scene.toml";
  WriteFile(file, text);
  return file;
}

// The channels of an exact file that belong to `name`.
inline ImageF Exact(const std::filesystem::path& file, const std::string& name) {
  std::vector<std::string> names;
  const ImageF all = ReadExr(file, &names);
  std::vector<int> channels;
  for (size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name || names[i].starts_with(name + ".")) channels.push_back(static_cast<int>(i));
  }
  ImageF image(all.width, all.height, static_cast<int>(channels.size()));
  for (size_t pixel = 0; pixel < size_t(all.width) * all.height; ++pixel) {
    for (size_t c = 0; c < channels.size(); ++c) {
      image.data[pixel * channels.size() + c] = all.data[pixel * all.channels + channels[c]];
    }
  }
  return image;
}

}  // namespace lumen::test
