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
  fs::path RenderTo(const std::string& name, const std::vector<std::string>& settings) {
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
  const std::string exact = "truth.exact=[\"radiance\", \"direct\", \"indirect\", \"albedo\", \"z\"]";
  const fs::path without = RenderTo("without", {exact});
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, "sensor.noise.read_e=20"})), Names{"0001_color.png"});
  EXPECT_EQ(Differing(without, RenderTo("again", {exact})), Names{});
}

// The gains follow the brighter picture; the wall's texture, geometry and motion are as they were.
TEST_F(EffectsTest, CoatChangesThePictureOnly) {
  const std::string exact = "truth.exact=[\"albedo\", \"z\", \"normal\", \"position\", \"flow\"]";
  const fs::path without = RenderTo("without", {exact});
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, "surface.coat.roughness=0.3"})),
            (Names{"0001_color.png", "sequence.toml"}));
}

TEST_F(EffectsTest, SubsurfaceChangesThePictureOnly) {
  const std::string exact = "truth.exact=[\"glint\", \"albedo\", \"z\", \"normal\", \"flow\"]";
  const fs::path without = RenderTo("without", {exact});
  const std::string tissue = "surface.subsurface.scattering_per_mm=[1, 1, 1]";
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, tissue})),
            (Names{"0001_color.png", "sequence.toml"}));
}

// Truth is that of the frame's moment.
TEST_F(EffectsTest, ShutterChangesThePictureOnly) {
  const std::string exact = "truth.exact=[\"albedo\", \"z\", \"flow\"]";
  const fs::path without = RenderTo("without", {exact});
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, "sensor.shutter.exposure=0.9"})),
            Names{"0001_color.png"});
  EXPECT_EQ(Differing(without, RenderTo("instant", {exact, "sensor.shutter.exposure=0"})), Names{});
}

// So it is where the wall moves within the exposure as well.
TEST_F(EffectsTest, WallMotionChangesThePictureOnly) {
  const std::string exact = "truth.exact=[\"albedo\", \"z\", \"normal\", \"flow\", \"mesh\"]",
                    rings = "peristalsis.amplitude=0.2", rate = "peristalsis.rate_hz=4";
  const fs::path without = RenderTo("without", {exact, rings, rate});
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, rings, rate, "sensor.shutter.exposure=0.9"})),
            Names{"0001_color.png"});
  EXPECT_EQ(Differing(without, RenderTo("instant", {exact, rings, rate, "sensor.shutter.exposure=0"})),
            Names{});
}

// The gains are those of a sharp picture.
TEST_F(EffectsTest, DefocusChangesThePictureOnly) {
  const std::string exact = "truth.exact=[\"albedo\", \"z\", \"normal\", \"position\", \"flow\"]";
  const fs::path without = RenderTo("without", {exact});
  EXPECT_EQ(Differing(without, RenderTo("with", {exact, "lens.defocus.aperture_mm=0.5"})),
            Names{"0001_color.png"});
  EXPECT_EQ(Differing(without, RenderTo("pinhole", {exact, "lens.defocus.aperture_mm=0"})), Names{});
}

TEST_F(EffectsTest, LensAndRecorderChangeThePictureOnly) {
  const std::string exact = "truth.exact=[\"radiance\", \"direct\", \"indirect\", \"albedo\", \"z\"]";
  const fs::path without = RenderTo("without", {exact});
  for (const std::string setting : {"lens.chromatic_aberration.red=0.01", "sensor.jpeg.quality=50"}) {
    EXPECT_EQ(Differing(without, RenderTo("with", {exact, setting})), Names{"0001_color.png"}) << setting;
  }
}

// Light from wall to wall comes on top of direct light, whose every bit stays.
TEST_F(EffectsTest, InterreflectionLeavesDirectLightAlone) {
  const std::string exact = "truth.exact=[\"direct\", \"albedo\", \"z\"]",
                    gain = "sensor.auto_gain.target=0.4";
  const fs::path with = RenderTo("with", {exact, gain});
  EXPECT_EQ(Differing(with, RenderTo("without", {exact, gain, "path.bounces=0"})),
            (Names{"0001_color.png", "sequence.toml"}));
}

// The wall's colour is no part of its shape; the loop of gain sees it.
TEST_F(EffectsTest, TextureLeavesGeometryAlone) {
  const std::string exact =
      "truth.exact=[\"z\", \"distance\", \"normal\", \"shading_normal\", \"position\", "
      "\"flow\", \"seen_before\", \"flow_next\", \"seen_after\", \"visibility\"]";
  const fs::path with = RenderTo("with", {exact});
  for (const std::string setting : {"surface.mottling.contrast=0.5", "surface.vessels.width_mm=2"}) {
    EXPECT_EQ(Differing(with, RenderTo("other", {exact, setting})),
              (Names{"0001_color.png", "sequence.toml"}))
        << setting;
  }
}

// Vignetting and gain belong to the picture, not to the light that is there.
TEST_F(EffectsTest, VignettingAndGainLeaveRadianceAlone) {
  const std::string exact = "truth.exact=[\"radiance\", \"direct\", \"indirect\", \"albedo\", \"z\"]";
  const fs::path with = RenderTo("with", {exact});
  for (const std::string setting : {"response.vignetting=0", "sensor.auto_gain.target=0.6"}) {
    EXPECT_EQ(Differing(with, RenderTo("other", {exact, setting})),
              (Names{"0001_color.png", "sequence.toml"}))
        << setting;
  }
}

}  // namespace
}  // namespace lumen
