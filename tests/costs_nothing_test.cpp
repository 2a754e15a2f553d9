// An effect that a scene doesn't name costs it nothing: callgrind counts no instruction of the effect's
// files, those inlined elsewhere included, and no buffer is allocated. lumen_effect_costs (effect_costs.cpp)
// is what is counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <vector>

#include "common/files.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// Whatever is named in it is no effect.
constexpr const char* kPlainScene = R"(geometry = {kind = "colon", length_mm = 40, tolerance_mm = 1}
trajectory = {kind = "withdrawal", start_mm = 20, end_mm = 16, frames = 2}
camera = {preset = "c3vd", width = 24, height = 20}
surface = {albedo = [0.7, 0.4, 0.3]}
response = {gamma = 2.2}
path = {samples = 1, bounces = 1}
light = {model = "sls", calibrated = true, source = [
  {position = [0, 0, 0], direction = [0, 0, 1], spread = 2.77, intensity = [3000, 3000, 3000]}]}
)";

struct Effect {
  std::string name;             // of its header
  std::string setting;          // that names it in a scene
  std::vector<std::string> of;  // files that serve it alone: without folder and ending
};

const std::vector<Effect> kEffects = {
    {"chromatic_aberration", "lens.chromatic_aberration.red=0.01", {"chromatic_aberration"}},
    {"coat", "surface.coat.roughness=0.2", {"coat", "glint_paths", "light_paths", "photon", "photon_joins"}},
    {"defocus", "lens.defocus.aperture_mm=0.3", {"defocus"}},
    {"jpeg", "sensor.jpeg.quality=85", {"jpeg"}},
    {"noise", "sensor.noise.read_e=20", {"noise"}},
    {"peristalsis", "peristalsis.amplitude=0.3", {"peristalsis"}},
    {"shutter", "sensor.shutter.exposure=0.5", {"shutter"}},
    {"subsurface",
     "surface.subsurface.scattering_per_mm=[1,1,1]",
     {"subsurface", "tissue_path", "tissue_walks"}},
    {"vessels", "surface.vessels.spacing_mm=12", {"vessels", "vessel_growth", "wall_places"}}};

// Direct light alone, in more pixels than a frame takes bytes that aren't pixels'.
constexpr int kDirectPixels = 60 * 48;
const std::string kDirect = "camera.width=60 camera.height=48 path.bounces=0";

using Instructions = std::map<std::string, int64_t>;  // by file, without folder and ending

// Adds what a file of callgrind's counts (Valgrind's manual, "Callgrind Format Specification"): costs belong
// to the file named last by fl=, fi= or fe=, where the compiler says that the line came from; what a call
// costs stands in the line after calls=, and once more in the function called. Names are spelt out once and
// are numbers after.
void AddInstructions(const fs::path& file, Instructions* counts) {
  std::ifstream stream(file);
  std::map<std::string, std::string> names;
  std::string current;
  bool called = false;
  for (std::string line; std::getline(stream, line);) {
    const size_t equals = line.find('=');
    const std::string key = line.substr(0, equals);
    if (equals != std::string::npos && std::set<std::string>{"fl", "fi", "fe", "cfl", "cfi"}.contains(key)) {
      const size_t end = line.find(')');
      const std::string number = line.substr(equals + 1, end - equals);
      if (end + 2 < line.size()) names[number] = fs::path(line.substr(end + 2)).stem().string();
      if (key[0] == 'f') current = names.at(number);
    } else if (key == "calls") {
      called = true;
    } else if (!line.empty() && std::string_view("0123456789+-*").find(line[0]) != std::string_view::npos) {
      if (!called) (*counts)[current] += std::stoll(line.substr(line.find(' ')));
      called = false;
    }
  }
}

// A scene's, as it was read and its first frame taken.
struct Counted {
  Instructions all;
  int64_t of_frame = 0;              // instructions
  size_t wall_bytes = 0, bytes = 0;  // allocated
  std::string picture;               // a hash
  int64_t Of(const Effect& effect) const {
    int64_t sum = 0;
    for (const std::string& file : effect.of) sum += all.contains(file) ? all.at(file) : 0;
    return sum;
  }
};

class CostsNothing : public testing::Test {
 protected:
  // All in one process, which has loaded its libraries once.
  static void SetUpTestSuite() {
    has_valgrind_ = std::system("valgrind --version >/dev/null 2>&1") == 0;
    if (!has_valgrind_) return;
    const test::ScratchFolder scratch;
    const fs::path scene = scratch / "plain.toml", output = scratch / "output", counts = scratch / "counts";
    WriteFile(scene, kPlainScene);
    std::vector<std::string> settings = {""};
    for (const Effect& effect : kEffects) settings.push_back(effect.setting);
    settings.insert(settings.end(), {"", kDirect, kDirect + " sensor.noise.read_e=20"});
    std::string command =
        "valgrind --tool=callgrind --dump-before=ReadPart --dump-before=FramePart "
        "--dump-after=FramePart --callgrind-out-file=" +
        counts.string() + " " LUMEN_EFFECT_COSTS " " + scene.string();
    for (const std::string& setting : settings) command += " '" + setting + "'";
    command += " >" + output.string() + " 2>" + (scratch / "log").string();
    ASSERT_EQ(std::system(command.c_str()), 0) << ReadFile(scratch / "log");
    std::istringstream lines(ReadFile(output));
    for (size_t i = 0; i < settings.size(); ++i) {
      Counted run;
      lines >> run.wall_bytes >> run.bytes >> run.picture;
      ASSERT_FALSE(lines.fail()) << "no line for " << settings[i];
      // A scene's dumps are what came before it, reading, and the frame.
      const auto dump = [&](size_t k) { return scratch / ("counts." + std::to_string(3 * i + k)); };
      Instructions frame;
      AddInstructions(dump(3), &frame);
      for (const auto& [file, count] : frame) run.of_frame += count;
      run.all = frame;
      AddInstructions(dump(2), &run.all);
      runs_.push_back(run);
    }
  }
  static void TearDownTestSuite() { runs_.clear(); }

  void SetUp() override {
    if (!has_valgrind_) GTEST_SKIP() << "valgrind is missing: apt-get install valgrind";
    ASSERT_FALSE(runs_.empty());
  }

  static const Counted& Plain() { return runs_[0]; }
  static const Counted& With(size_t effect) { return runs_[1 + effect]; }
  static const Counted& PlainAgain() { return runs_[1 + kEffects.size()]; }
  static const Counted& Direct() { return runs_[2 + kEffects.size()]; }
  static const Counted& DirectWithNoise() { return runs_[3 + kEffects.size()]; }

  static inline bool has_valgrind_ = false;
  static inline std::vector<Counted> runs_;
};

TEST_F(CostsNothing, EveryEffectIsCounted) {
  std::set<std::string> counted, there;
  for (const Effect& effect : kEffects) counted.insert(effect.name);
  for (const auto& entry : fs::recursive_directory_iterator(LUMEN_SOURCE_FOLDER "/sim")) {
    if (entry.path().extension() == ".h" && ReadFile(entry.path()).starts_with("// Effect:"))
      there.insert(entry.path().stem().string());
  }
  EXPECT_EQ(counted, there);
}

// A scene that names one effect runs that one's files and no other's: what finds nothing in the plain scene
// does find something where there is something to find.
TEST_F(CostsNothing, FilesRunOnlyWhereTheirEffectIsNamed) {
  for (const Effect& effect : kEffects) {
    EXPECT_EQ(Plain().Of(effect), 0) << effect.name << " in the plain scene";
    for (size_t named = 0; named < kEffects.size(); ++named) {
      if (kEffects[named].name == effect.name) {
        EXPECT_GT(With(named).Of(effect), 0) << effect.name;
      } else {
        EXPECT_EQ(With(named).Of(effect), 0)
            << effect.name << " where " << kEffects[named].name << " is named";
      }
    }
  }
}

// Nothing of an effect stays: after all of them the plain frame has the same bytes and, but for what the
// heap's state makes of its calls (0.01%), the same instructions. Whatever an effect adds is more than the
// bound, but for JPEG, for which there is a stand-in here.
TEST_F(CostsNothing, PlainFrameIsThatBeforeTheEffects) {
  const auto added = [](const Counted& run) {
    return run.of_frame / static_cast<double>(Plain().of_frame) - 1;
  };
  EXPECT_EQ(PlainAgain().picture, Plain().picture);
  EXPECT_EQ(PlainAgain().bytes, Plain().bytes);
  EXPECT_LT(std::abs(added(PlainAgain())), 1e-3);
  for (size_t i = 0; i < kEffects.size(); ++i) {
    RecordProperty(kEffects[i].name, std::to_string(added(With(i))));
    EXPECT_NE(With(i).picture, Plain().picture) << kEffects[i].name;
    if (kEffects[i].name != "jpeg") {
      EXPECT_GT(std::abs(added(With(i))), 1e-3) << kEffects[i].name;
    }
  }
}

// Of direct light: mask 1, vignetting 4, radiance 12, picture 3. What is no buffer is less than a byte a
// pixel.
TEST_F(CostsNothing, NoBufferIsAllocated) {
  constexpr size_t kPlainBytes = 20 * kDirectPixels;
  EXPECT_GE(Direct().bytes, kPlainBytes);
  EXPECT_LT(Direct().bytes, kPlainBytes + kDirectPixels);
  EXPECT_GE(DirectWithNoise().bytes, kPlainBytes + kDirectPixels);
  // Whoever has a copy of something is seen to have it: the moved wall, or pixels.
  for (size_t i = 0; i < kEffects.size(); ++i) {
    const std::string& name = kEffects[i].name;
    if (name == "peristalsis") {
      EXPECT_GT(With(i).wall_bytes, Plain().wall_bytes);
    } else if (name == "noise" || name == "jpeg" || name == "chromatic_aberration" || name == "coat") {
      EXPECT_GT(With(i).bytes, Plain().bytes) << name;
    }
  }
}

}  // namespace
}  // namespace lumen
