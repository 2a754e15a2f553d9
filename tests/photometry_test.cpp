// The regression of the photometric model, on sequences whose light, wall and gains are known: rendered ones
// with a uniform wall, pixels drawn by hand, and C3VD's real frame.
#include "recon/photometry/photometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>

#include "common/files.h"
#include "recon/photometry/baseline.h"
#include "recon/photometry/report.h"
#include "sim/render.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

// A way back through a short tube, and what follows its light.
const std::string kJourney = R"([trajectory]
kind = "withdrawal"
start_mm = 44
end_mm = 14
frames = 4
wobble_mm = 4
wobble_rad = 0.2
[camera]
preset = "c3vd"
width = 150
height = 120
[light]
model = "sls"
)";

// A plain wall, one sample through each pixel's centre, gains that differ; ends in [truth].
const std::string kWallAndSensor = R"([surface]
albedo = [0.3, 0.3, 0.3]
[path]
samples = 1
bounces = 0
[sensor.auto_gain]
target = 0.35
settling_s = 0.05
[truth]
)";

// Folds, light at the camera.
const std::string kFolds = R"([geometry]
kind = "colon"
length_mm = 60
diameter_mm = 40
bend_rad = 0.5
tolerance_mm = 0.1
)" + kJourney + R"([[light.source]]
position = [0, 0, 0]
direction = [0, 0, 1]
spread = 2.5
intensity = [3000, 2700, 2400]
[response]
gamma = 2.2
vignetting = 0.7
)" + kWallAndSensor + R"(exact = ["radiance"]
)";

// A tube without folds, so that guides off the axis cast no shadows.
const std::string kTube = R"([geometry]
kind = "colon"
length_mm = 60
diameter_mm = 40
bend_rad = 0
fold_height_mm = 0
haustra_depth_mm = 0
taenia_depth_mm = 0
irregularity_mm = 0
tolerance_mm = 0.1
)" + kJourney + R"([[light.source]]
position = [3.24, 0.55, 0]
direction = [0, 0, 1]
spread = 2.9
intensity = [1200, 1100, 1000]
[[light.source]]
position = [-2.77, 2.66, 0]
direction = [0.1, 0, 0.995]
spread = 2.5
intensity = [900, 1000, 1100]
[[light.source]]
position = [-1.27, -3.14, 0]
direction = [0, 0, 1]
spread = 2.1
intensity = [800, 800, 800]
[response]
gamma = 1.8
)" + kWallAndSensor;

void RenderTo(const std::filesystem::path& folder, const std::string& scene) {
  CreateFolder(folder);
  WriteFile(folder / "scene.toml", scene);
  Render(ReadScene(folder / "scene.toml", {}, 0), {.folder = folder});
}

Photometry FitFolder(const std::filesystem::path& folder, const PhotometryOptions& options = {}) {
  const Sequence sequence = ReadSequence(folder);
  return FitPhotometry(Observe(sequence, options), options);
}

const Figure& Get(const Photometry& photometry, const std::string& name) {
  const Figure* figure = photometry.Find(name);
  if (figure == nullptr) throw std::runtime_error("no figure " + name);
  return *figure;
}

// Within four standard errors of what the sequence itself says, and these small enough to mean something.
void ExpectAsCalibrated(const Photometry& photometry, const std::string& name, double largest_error) {
  const Figure& figure = Get(photometry, name);
  ASSERT_TRUE(figure.expected) << name;
  EXPECT_NEAR(figure.value, *figure.expected, 4 * figure.standard_error) << name;
  EXPECT_GT(figure.standard_error, 0) << name;
  EXPECT_LT(figure.standard_error, largest_error) << name;
}

void ExpectIdeal(const Photometry& photometry, double spread, double gamma) {
  EXPECT_EQ(Get(photometry, "t_exponent").expected, -2.0);
  EXPECT_EQ(Get(photometry, "cos_exponent").expected, 1.0);
  EXPECT_NEAR(*Get(photometry, "spread").expected, spread, 1e-12);
  EXPECT_EQ(Get(photometry, "gamma").expected, gamma);
  for (const std::string name : {"t_exponent", "cos_exponent", "spread", "gamma", "gamma_from_gains"}) {
    ExpectAsCalibrated(photometry, name, 0.0005);  // −2.000, 1.000: to the last of these digits
  }
  for (const std::string channel : {"red", "green", "blue"}) {
    for (const std::string name : {".t_exponent", ".cos_exponent", ".spread"}) {
      ExpectAsCalibrated(photometry, channel + name, 0.0007);
    }
  }
  for (int frame = 0; frame < 4; ++frame) ExpectAsCalibrated(photometry, GainFigureName(frame), 0.0002);
}

TEST(Photometry, FindsLightGammaAndGainsOfAnIdealSequence) {
  const ScratchFolder scratch;
  RenderTo(scratch / "seq", kFolds);
  const Sequence sequence = ReadSequence(scratch / "seq");
  const Observations observations = Observe(sequence, {});
  const Photometry photometry = FitPhotometry(observations, {});
  ExpectIdeal(photometry, 2.5, 2.2);
  // The gains aren't all the same, or they would prove nothing.
  EXPECT_GT(std::abs(*Get(photometry, GainFigureName(0)).expected), 0.1);

  // What is left is rounding: a variance of γ²/(12 c²) at code c.
  double variance = 0;
  for (const auto& code : observations.code) {
    for (uint8_t c : code) variance += c > 0 ? 2.2 * 2.2 / (12.0 * c * c) : 0;
  }
  EXPECT_NEAR(photometry.all.residual, std::sqrt(variance / photometry.all.count),
              0.02 * photometry.all.residual);
  EXPECT_GT(photometry.all.r_squared, 0.999);
}

TEST(Photometry, FindsTheSpreadOfSeveralGuidesOffTheAxis) {
  const ScratchFolder scratch;
  RenderTo(scratch / "seq", kTube);
  const Photometry photometry = FitFolder(scratch / "seq");
  ExpectIdeal(photometry, 2.5, 1.8);

  // Taking the guides for one light at the camera must show, or the fit would be blind to where they are.
  Sequence sequence = ReadSequence(scratch / "seq");
  sequence.calibration.light.sources.resize(1);
  sequence.calibration.light.sources[0].position.setZero();
  const Photometry moved = FitPhotometry(Observe(sequence, {}), {});
  EXPECT_GT(moved.all.residual, 2 * photometry.all.residual);
}

TEST(Photometry, SameFiguresForAnyNumberOfThreads) {
  const ScratchFolder scratch;
  RenderTo(scratch / "seq", kFolds);
  const auto run = [&](int threads) {
    return std::system((std::string(LUMEN_COMMAND) + " photometry --quiet --threads " +
                        std::to_string(threads) + " '" + (scratch / "seq").string() + "' --json '" +
                        (scratch / std::to_string(threads)).string() + "' >/dev/null")
                           .c_str());
  };
  ASSERT_EQ(run(1), 0);
  ASSERT_EQ(run(3), 0);
  EXPECT_EQ(ReadFile(scratch / "1"), ReadFile(scratch / "3"));
}

// Pixels drawn by hand: places with an albedo of their own, which all pixels of the place share.
struct Drawn {
  Sequence sequence;
  Observations observations;
};

std::unique_ptr<Drawn> Draw(uint32_t seed) {
  constexpr int kCells = 120, kPixels = 25;
  auto drawn = std::make_unique<Drawn>();
  drawn->sequence.frames.resize(1);
  LightSource source;
  source.spread = 2;
  drawn->sequence.calibration.light.sources = {source};
  Observations& all = drawn->observations;
  all.sequence = &drawn->sequence;
  all.sources = 1;
  all.constants = {{Vec3d::Zero(), 0}};
  all.frames = {0};
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  for (int cell = 0; cell < kCells; ++cell) {
    all.cell_begin.push_back(all.size());
    const double albedo = 0.3 * normal(random);
    const double log_t = std::log(15.0) + uniform(random), log_cos = -1.2 * uniform(random);
    const double axis = 0.4 * uniform(random);
    for (int i = 0; i < kPixels; ++i) {
      const SourceGeometry geometry = {float(log_t + 0.02 * uniform(random)),
                                       float(log_cos - 0.02 * uniform(random)), float(axis)};
      const double value =
          albedo + 4.5 - 2 * geometry.log_distance + geometry.log_cos - 2 * geometry.one_minus_cos_axis;
      const double code = 255 * std::exp(value / 2.2);
      all.frame.push_back(0);
      const uint8_t rounded = static_cast<uint8_t>(std::lround(std::min(code, 254.0)));
      all.code.push_back({rounded, rounded, rounded});
      all.log_vignetting.push_back(0);
      all.geometry.push_back(geometry);
    }
  }
  all.cell_begin.push_back(all.size());
  return drawn;
}

// The figures of many draws scatter as their standard errors say: with 80 draws the ratio is known to 8%.
// Errors that took every pixel for independent would be √(25 · 3) times too small.
TEST(Photometry, StandardErrorsAreThoseOfThePlacesOnTheWall) {
  constexpr int kDraws = 80;
  for (Parameter parameter : {Parameter::kTExponent, Parameter::kCosExponent, Parameter::kSpread}) {
    double sum = 0, squares = 0, variance = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      const Fit fit = FitModel(Draw(draw + 1)->observations, {});
      const double value = fit.values[int(parameter)];
      sum += value;
      squares += value * value;
      variance += std::pow(fit.standard_error[int(parameter)], 2) / kDraws;
    }
    const double mean = sum / kDraws;
    const double scatter = std::sqrt(squares / kDraws - mean * mean);
    EXPECT_NEAR(scatter / std::sqrt(variance), 1, 0.3) << int(parameter);
  }
}

TEST(Photometry, PixelsThatTellNothingApartAreRefused) {
  const auto drawn = Draw(1);
  for (SourceGeometry& geometry : drawn->observations.geometry) geometry.log_distance = 3;
  EXPECT_NE(ErrorOf([&] { FitModel(drawn->observations, {}); }).find("can't tell distance"),
            std::string::npos);
}

// Depth and normals of a step between two planes that face the camera, 20 and 22 mm away.
TEST(Photometry, PixelsAtAStepInDepthAreLeftOut) {
  const ScratchFolder scratch;
  Sequence sequence;
  sequence.folder = scratch.path();
  CameraIntrinsics& camera = sequence.calibration.camera;
  camera.width = camera.height = 64;
  camera.cx = camera.cy = 31.5;
  camera.fx = camera.fy = 40;
  LightSource source;
  sequence.calibration.light.sources = {source};
  ImageF z(64, 64, 1, 20.0f), normal(64, 64, 3);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      normal.Pixel(x, y)[2] = -1;
      if (x >= 40) *z.Pixel(x, y) = 22;
    }
  }
  SequenceFrame frame;
  frame.color = scratch / "color.png";
  frame.depth = scratch / "depth.tiff";
  frame.normals = scratch / "normals.tiff";
  WriteImage(frame.color, Image8(64, 64, 3, 100));
  WriteImage(frame.depth, EncodeDepth(z));
  WriteImage(frame.normals, EncodeNormals(normal));
  sequence.frames = {frame};
  PhotometryOptions options;
  options.cell_mm = 4;
  const Observations observations = Observe(sequence, options);
  EXPECT_EQ(observations.edges, 2 * 64);  // a column on either side
  EXPECT_EQ(observations.size(), 62 * 64);
  options.max_jump = 0.11;  // the step is 10%
  EXPECT_EQ(Observe(sequence, options).edges, 0);
}

// Takes a frame's picture again with the wall's radiance times a factor of distance, from what was rendered
// before any rounding.
template <class Factor>
void ChangeFrame(const Sequence& sequence, int frame, const Factor& factor) {
  Image8 color = ReadColor(sequence, sequence.frames[frame]);
  const ImageF z = DecodeDepth(ReadImage16(sequence.frames[frame].depth, 1));
  std::vector<std::string> names;
  const ImageF radiance =
      ReadExr(sequence.folder / "exact" / ("000" + std::to_string(frame) + ".exr"), &names);
  const Response& response = sequence.calibration.response;
  const Camera<double> camera(sequence.calibration.camera);
  for (int y = 0; y < color.height; ++y) {
    for (int x = 0; x < color.width; ++x) {
      const auto ray = camera.Unproject(Vec2d(x, y));
      if (!ray) continue;
      const double scale =
          *sequence.frames[frame].gain * Vignetting(response, ray->z()) * factor(*z.Pixel(x, y) / ray->z());
      for (int c = 0; c < 3; ++c) {
        const auto name = std::find(names.begin(), names.end(), std::string("radiance.") + "RGB"[c]);
        color.Pixel(x, y)[c] = Quantise(Encode(response, scale * radiance.Pixel(x, y)[name - names.begin()]));
      }
    }
  }
  WriteImage(sequence.frames[frame].color, color);
}

class PhotometryCommand : public testing::Test {
 protected:
  // A sequence and the baseline of its first run.
  PhotometryCommand() {
    RenderTo(scratch_ / "seq", kFolds);
    EXPECT_EQ(Run("--write-baseline " + Path("baseline.toml")), 0) << Err();
  }

  int Run(const std::string& arguments) {
    const std::string command = std::string(LUMEN_COMMAND) + " photometry " + Path("seq") + " " + arguments +
                                " >" + Path("out") + " 2>" + Path("err");
    return WEXITSTATUS(std::system(command.c_str()));
  }
  std::string Path(const std::string& name) const { return "'" + (scratch_ / name).string() + "'"; }
  std::string Err() const { return ReadFile(scratch_ / "err"); }
  bool Says(const std::string& figure) const {
    return Err().find("lumen: " + figure + ": ") != std::string::npos;
  }

  ScratchFolder scratch_;
};

TEST_F(PhotometryCommand, WritesTablePictureAndJsonAndKeepsItsBaseline) {
  ASSERT_EQ(Run("--baseline " + Path("baseline.toml") + " -o " + Path("result") + " --json " + Path("json")),
            0)
      << Err();
  const nlohmann::json json = nlohmann::json::parse(ReadFile(scratch_ / "json"));
  EXPECT_TRUE(json["baseline"]["outside"].empty());
  EXPECT_GT(json["baseline"]["compared"], 20);
  const Photometry photometry = FitFolder(scratch_ / "seq");
  EXPECT_EQ(json["figures"]["t_exponent"]["value"], Get(photometry, "t_exponent").value);
  EXPECT_EQ(json["figures"]["log_gain.0002"]["standard_error"],
            Get(photometry, "log_gain.0002").standard_error);
  EXPECT_EQ(json["residual_by_distance_mm"].size(), photometry.by_distance.size());
  EXPECT_GT(ReadImage8(scratch_ / "result" / "photometry.png", 3).width, 1000);
  char row[64];
  std::snprintf(row, sizeof(row), "t_exponent        -2.0000  %.5f ± ", Get(photometry, "t_exponent").value);
  EXPECT_NE(ReadFile(scratch_ / "out").find(row), std::string::npos) << ReadFile(scratch_ / "out");
}

TEST_F(PhotometryCommand, NamesAFalloffThatIsWrong) {
  const Sequence sequence = ReadSequence(scratch_ / "seq");
  for (int frame = 0; frame < 4; ++frame) {
    ChangeFrame(sequence, frame, [](double t) { return std::pow(t / 30, 0.02); });
  }
  EXPECT_EQ(Run("--baseline " + Path("baseline.toml") + " --json " + Path("json")), 1);
  EXPECT_TRUE(Says("t_exponent")) << Err();
  EXPECT_TRUE(Says("green.t_exponent")) << Err();
  EXPECT_FALSE(Says("cos_exponent")) << Err();
  const nlohmann::json json = nlohmann::json::parse(ReadFile(scratch_ / "json"));
  // A line each, and one that sums up.
  const std::string said = Err();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), json["baseline"]["outside"].size() + 1);
  EXPECT_NEAR(json["figures"]["t_exponent"]["value"], -1.98, 0.002);
}

TEST_F(PhotometryCommand, NamesAGainThatWasAltered) {
  ChangeFrame(ReadSequence(scratch_ / "seq"), 2, [](double) { return 1.02; });
  EXPECT_EQ(Run("--baseline " + Path("baseline.toml")), 1);
  EXPECT_TRUE(Says("log_gain.0002")) << Err();
  EXPECT_FALSE(Says("t_exponent")) << Err();
  EXPECT_FALSE(Says("gamma")) << Err();
}

TEST_F(PhotometryCommand, NamesWhatIsWrongWithABaseline) {
  const std::string head = "format = \"lumen-photometry-baseline\"\nversion = 1\n";
  const auto expect_error = [&](const std::string& text, const std::string& expected) {
    WriteFile(scratch_ / "bad.toml", text);
    const std::string said = ErrorOf([&] { ReadBaseline(scratch_ / "bad.toml"); });
    EXPECT_NE(said.find("bad.toml" + expected), std::string::npos) << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 0) << said;
  };
  expect_error(head + "figure = [{name = \"spread\", low = 2, high = 1}]\n", ":3: figure.0.high");
  expect_error(head + "figure = [\n{name = \"spread\", low = 2, high = 3, hihg = 4}]\n", ":4: figure.0.hihg");
  expect_error(head + "figure = [\n{name = \"a\", low = 2, high = 3},\n{name = \"a\", low = 2, high = 3}]\n",
               ":5: figure.1.name");
  expect_error(head + "figure = []\n", ":3: figure");
  expect_error("version = 1\n", ":1: format");
  expect_error(head + "figure = [\n", ":");
  expect_error(head + "figure = [{name = \"spread\", low = 1}]\n", ":3: figure.0.high");
  EXPECT_EQ(Run("--baseline " + Path("bad.toml")), 1);
  const std::string said = Err();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;

  WriteFile(scratch_ / "other.toml", head + "figure = [{name = \"log_gain.0099\", low = 0, high = 1}]\n");
  EXPECT_EQ(Run("--baseline " + Path("other.toml")), 1);
  EXPECT_TRUE(Says("log_gain.0099")) << Err();
}

TEST_F(PhotometryCommand, LeavesOutFramesThatShowNothingAndRefusesASequenceWithoutTruth) {
  const Sequence sequence = ReadSequence(scratch_ / "seq");
  WriteImage(sequence.frames[1].color, Image8(150, 120, 3, 0));
  WriteImage(sequence.frames[3].color, Image8(150, 120, 3, 255));
  const Photometry photometry = FitFolder(scratch_ / "seq");
  EXPECT_EQ(photometry.frame_numbers, (std::vector<int>{0, 2}));
  EXPECT_EQ(photometry.left_out, (std::vector<int>{1, 3}));
  ExpectAsCalibrated(photometry, "t_exponent", 0.001);

  for (const SequenceFrame& frame : sequence.frames) std::filesystem::remove(frame.normals);
  EXPECT_EQ(Run(""), 1);
  EXPECT_NE(Err().find("no frame has depth and normals"), std::string::npos) << Err();
}

// C3VD's frame under one light at the camera, against an analysis of the same frame by other code (least
// squares on log(I^2.2), over 1.3 million unsaturated pixels). Which of the darkest, flattest, brightest and
// outermost pixels that one took isn't on record; the choice moves the figures by as much as the tolerances,
// a fraction of the standard errors, which the frame's 136 places leave at 0.08 for the exponents.
TEST(Photometry, RealFrameBearsTheModelOut) {
  LUMEN_NEEDS_DATA("c3vd/trans_t4_a_frame0010");
  Sequence sequence = ReadSequence(SharedData("c3vd/trans_t4_a_frame0010"));
  LightSource& light = sequence.calibration.light.sources.at(0);
  light.position.setZero();
  light.direction = Vec3d::UnitZ();
  const Observations observations = Observe(sequence, {});
  const struct {
    int channel;
    double t_exponent, cos_exponent, spread, r_squared;
  } known[] = {{1, -2.00, 0.88, 2.62, 0.755}, {2, -2.05, 0.92, 2.58, 0.771}};
  for (const auto& [channel, t_exponent, cos_exponent, spread, r_squared] : known) {
    FitOptions options;
    options.channels = {channel};
    const Fit fit = FitModel(observations, options);
    const auto expect = [&](double value, double error, double expected, double tolerance) {
      EXPECT_NEAR(value, expected, tolerance) << "channel " << channel;
      EXPECT_LT(tolerance, error) << "channel " << channel;
      EXPECT_LT(error, 0.3) << "channel " << channel;
    };
    const auto expect_parameter = [&](Parameter parameter, double expected, double tolerance) {
      expect(fit.values[int(parameter)], fit.standard_error[int(parameter)], expected, tolerance);
    };
    expect_parameter(Parameter::kTExponent, t_exponent, 0.05);
    expect_parameter(Parameter::kCosExponent, cos_exponent, 0.04);
    expect_parameter(Parameter::kSpread, spread, 0.03);
    expect(fit.r_squared, fit.r_squared_error, r_squared, 0.03);
    expect(fit.residual, fit.residual_error, 0.41, 0.01);
    EXPECT_NEAR(fit.count, 1.3e6, 0.05e6);
    if (channel == 1) {
      EXPECT_NEAR(fit.scatter, 0.84, 0.03);
    }
  }
}

}  // namespace
}  // namespace lumen::test
