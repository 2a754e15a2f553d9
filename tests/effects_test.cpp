// An effect that a scene names changes what it is about, and nothing else.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "sim/render.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kSeed = 4;

class EffectsTest : public testing::Test {
 protected:
  fs::path RenderTo(const std::string& name, std::vector<std::string> settings) {
    settings.push_back("truth.exact=[\"radiance\", \"direct\", \"albedo\", \"z\", \"normal\"]");
    const Scene scene = ReadScene(test::WriteScene(scratch_), settings, kSeed);
    Render(scene, {scratch_ / name, 1, 2, kSeed});
    return scratch_ / name;
  }
  // The files of folder `a` whose bytes differ in `b`.
  static std::set<std::string> Differing(const fs::path& a, const fs::path& b) {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(a)) {
      if (!entry.is_regular_file()) continue;
      const fs::path name = fs::relative(entry.path(), a);
      if (ReadFile(entry.path()) != ReadFile(b / name)) names.insert(name.string());
    }
    return names;
  }
  test::ScratchFolder scratch_;
};

using Names = std::set<std::string>;

TEST_F(EffectsTest, SensorNoiseChangesThePictureOnly) {
  const fs::path without = RenderTo("without", {}), with = RenderTo("with", {"sensor.noise.read_e=20"});
  EXPECT_EQ(Differing(without, with), (Names{"0001_color.png"}));
  EXPECT_EQ(Differing(without, RenderTo("again", {})), Names{});
}

}  // namespace
}  // namespace lumen
