// How fast the path tracer is: samples a CPU second, CPU seconds to a given noise, memory, threads, and how
// time grows with pixels, samples and triangles; first, what finding triangles alone costs. Prints one table.
// CPU seconds are the process's, medians of runs.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <optional>

#include "common/parallel.h"
#include "common/progress.h"
#include "common/random.h"
#include "sim/cost/frame_setup.h"
#include "sim/cost/reference.h"
#include "sim/cost/timing.h"
#include "tools/bench_memory.h"
#include "tools/bench_rays.h"

namespace lumen {
namespace {

using Settings = std::vector<std::string>;

const Settings kTexture = {"surface.mottling.contrast=0.2", "surface.mottling.scale_mm=7",
                           "surface.vessels.spacing_mm=7", "surface.vessels.width_mm=0.35"};
const Settings kCoat = {"surface.coat.ior=1.37", "surface.coat.roughness=0.2"};
// A coat's direct glints want more samples than light between walls, and take little of the time.
const Settings kManyDirect = {"path.direct_oversampling=8"};
const Settings kEightVertices = {"path.bounces=7"};

constexpr int kMostFrames = 8;  // that the memory of is measured

// Guides of one CF-H190L, mm.
constexpr double kGuides[3][2] = {{3.24, 0.55}, {-2.77, 2.66}, {-1.27, -3.14}};

struct Arguments {
  std::filesystem::path scene = LUMEN_SOURCE_FOLDER "/scenes/bench/colon.toml";
  double seconds = 60;  // CPU seconds that one render may take
  int runs = 3;
  bool large = false;
  std::string only;                              // a section; empty = all
  std::optional<std::pair<int, int>> memory_of;  // samples, frames: prints the MB of tracing them instead
};

Settings operator+(Settings a, const Settings& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// A scene with what it takes to trace its first frame.
struct Subject {
  Scene scene;
  MovingWall walls;
  FrameSetup setup;

  explicit Subject(Scene from)
      : scene(std::move(from)),
        walls(scene.geometry, {scene.peristalsis, scene.surface.coat.has_value()}),
        setup(scene, &walls, 0, 0) {}
};

// guides: how many off the axis; 0 = one source at the camera.
Scene SceneWith(const Arguments& arguments, const Settings& settings, int guides) {
  Scene scene = ReadScene(arguments.scene, settings, 0);
  std::vector<LightSource>& sources = scene.calibration.light.sources;
  const LightSource one = sources[0];
  for (int i = 0; i < guides; ++i) {
    sources.resize(static_cast<size_t>(i) + 1, one);
    sources[i].position = Vec3d(kGuides[i][0], kGuides[i][1], 0);
    sources[i].intensity = one.intensity / guides;
  }
  return scene;
}

double CpuSecondsOfFrame(const Subject& subject, const PathOptions& options, int runs, PathCount* count) {
  std::vector<double> seconds;
  for (int run = 0; run < runs; ++run) {
    seconds.push_back(CpuSecondsOf([&] { subject.setup.Trace(options, RandomBits(1, run), count); }));
  }
  return MedianOf(seconds);
}

RayRates EmbreeAlone(const Arguments& arguments) {
  const Subject subject(SceneWith(arguments, {}, 0));
  const RayRates rates = MeasureRays(subject.scene, subject.setup.wall(), arguments.runs);
  fmt::print("\nEmbree alone, one core, {} triangles\n", subject.scene.geometry.mesh.faces.size());
  const auto line = [](const char* name, double rate) {
    fmt::print("  {:<40}{:>8.2f} Mrays/CPU-s\n", name, rate);
  };
  line("primary rays in packets of 16", rates.primary);
  line("shadow rays from there, packets of 16", rates.shadow);
  line("diffuse bounces from there, one by one", rates.bounce);
  return rates;
}

void DirectLight(const Arguments& arguments, double primary_rate) {
  fmt::print("\ndirect light, a textured wall of {} triangles\n",
             SceneWith(arguments, {}, 0).geometry.mesh.faces.size());
  const std::pair<int, const char*> kCases[] = {
      {0, "light at the camera"}, {1, "one guide off the axis"}, {3, "three guides"}};
  for (const auto& [guides, name] : kCases) {
    const Subject subject(SceneWith(arguments, kTexture, guides));
    PathOptions options = subject.scene.path;
    options.samples = 16;
    PathCount count;
    const double seconds = CpuSecondsOfFrame(subject, options, arguments.runs, &count);
    const double rate = 1e-6 * static_cast<double>(count.samples) / seconds;
    fmt::print("  {:<40}{:>8.2f} Msamples/CPU-s ({:.0f}% of Embree's primary packets){:>8.2f} Mrays/CPU-s\n",
               name, rate, 100 * rate / primary_rate, 1e-6 * static_cast<double>(count.rays) / seconds);
  }
}

void Rays(const Arguments& arguments) { DirectLight(arguments, EmbreeAlone(arguments).primary); }

// CPU seconds and noise of a render with so many samples; the noise from two with different random numbers.
struct Trial {
  int samples;
  double seconds, noise;
};

Trial TrialOf(const Subject& subject, PathOptions options, int samples, ErrorMeasure measure) {
  options.samples = samples;
  Trial trial{samples, 0, 0};
  Luminance pictures[2];
  std::vector<double> seconds;
  for (int k = 0; k < 2; ++k) {
    ImageF radiance;
    seconds.push_back(
        CpuSecondsOf([&] { radiance = subject.setup.Trace(options, RandomBits(2, samples, k)); }));
    pictures[k] = LuminanceOf(radiance, subject.setup.valid());
  }
  trial.seconds = (seconds[0] + seconds[1]) / 2;
  // The reference's noise is that of the mean of both: less than one's by √2.
  trial.noise = std::sqrt(2.0) * Reference(pictures[0], pictures[1]).Noise(measure);
  return trial;
}

// CPU seconds to a noise: the number of samples is doubled until it is reached, and the last two are
// interpolated (logarithms). Where that would take too long, extrapolated by 1/√samples, and said so.
std::string TimeToNoise(const Subject& subject, double noise, ErrorMeasure measure, double limit_seconds) {
  Trial before = TrialOf(subject, subject.scene.path, 1, measure);
  if (before.noise <= noise)
    return fmt::format("{:>8.3f} CPU-s (1 sample has {:.2f}%)", before.seconds, 100 * before.noise);
  for (;;) {
    if (2 * before.seconds > limit_seconds) {
      const double factor = std::pow(before.noise / noise, 2);
      return fmt::format("{:>8.2f} CPU-s (extrapolated {:.1f} times from {} samples, {:.2f}%)",
                         before.seconds * factor, factor, before.samples, 100 * before.noise);
    }
    const Trial next = TrialOf(subject, subject.scene.path, 2 * before.samples, measure);
    if (next.noise <= noise) {
      const double t = std::log(before.noise / noise) / std::log(before.noise / next.noise);
      return fmt::format("{:>8.3f} CPU-s ({:.1f} samples)",
                         before.seconds * std::pow(next.seconds / before.seconds, t),
                         before.samples * std::pow(2, t));
    }
    before = next;
  }
}

void Noise(const Arguments& arguments) {
  fmt::print("\nCPU seconds to a noise, 8 vertices\n");
  const Subject diffuse(SceneWith(arguments, kEightVertices, 0));
  const auto line = [&](const char* name, const Subject& subject, double noise, ErrorMeasure measure) {
    fmt::print("  {:<40}{}\n", name, TimeToNoise(subject, noise, measure, arguments.seconds));
  };
  line("diffuse, pixels to 5.5%", diffuse, 0.055, ErrorMeasure::kPixels);
  line("diffuse, pixels to 1%", diffuse, 0.01, ErrorMeasure::kPixels);
  line("diffuse, 8x8 blocks to 0.5%", diffuse, 0.005, ErrorMeasure::kBlocks);
  const Subject whole(SceneWith(arguments, kEightVertices + kTexture + kCoat + kManyDirect, 3));
  line("texture, coat, 3 guides, to 5.5%", whole, 0.055, ErrorMeasure::kPixels);
}

// The sensor's noise at gain 1, root mean square over valid pixels and channels, from its definition
// (noise.h).
double SensorNoiseOf(const SensorNoise& noise, const ImageF& radiance, const Image8& valid) {
  double sum = 0;
  int64_t count = 0;
  for (int i = 0; i < valid.width * valid.height; ++i) {
    if (!valid.data[i]) continue;
    for (int c = 0; c < 3; ++c) sum += radiance.data[3 * i + c] / noise.full_scale_e;
    ++count;
  }
  return std::sqrt(sum / (3 * double(count)) + std::pow(noise.read_e / noise.full_scale_e, 2));
}

double NoiseOfChannels(const ImageF& a, const ImageF& b, const Image8& valid) {
  double sum = 0;
  int64_t count = 0;
  for (int i = 0; i < valid.width * valid.height; ++i) {
    if (!valid.data[i]) continue;
    for (int c = 0; c < 3; ++c) sum += std::pow(double(a.data[3 * i + c]) - b.data[3 * i + c], 2) / 2;
    ++count;
  }
  return std::sqrt(sum / (3 * double(count)));
}

// A large frame's neighbouring pixels see nearly the same: one sample of light between walls a pixel is
// enough, by as many shared paths as it takes.
void WholeFrame(const Arguments& arguments) {
  const Subject subject(SceneWith(
      arguments, kTexture + Settings{"camera.width=1350", "camera.height=1080", "path.bounces=3"}, 0));
  const SensorNoise sensor;
  PathOptions options = subject.scene.path;
  options.samples = 1;
  options.direct_oversampling = 4;
  fmt::print("\n1350x1080, 3 bounces, textured, at the noise of the sensor (10000 e, read 5 e, gain 1)\n");
  double seconds_before = 0, excess_before = 0;  // noise over the sensor's
  for (options.shared_paths = 16;; options.shared_paths *= 2) {
    ImageF pictures[2];
    double seconds = 0;
    for (int k = 0; k < 2; ++k) {
      seconds += CpuSecondsOf([&] { pictures[k] = subject.setup.Trace(options, RandomBits(3, k)); }) / 2;
    }
    const double noise = NoiseOfChannels(pictures[0], pictures[1], subject.setup.valid());
    const double limit = SensorNoiseOf(sensor, pictures[0], subject.setup.valid());
    fmt::print("  {:>4} shared paths: noise {:.5f}, sensor's {:.5f} {:>15.2f} CPU-s\n", options.shared_paths,
               noise, limit, seconds);
    const double excess = noise / limit;
    if (excess <= 1 && excess_before > 1) {
      const double t = std::log(excess_before) / std::log(excess_before / excess);
      fmt::print("  interpolated (logarithms){:>39.2f} CPU-s\n",
                 seconds_before * std::pow(seconds / seconds_before, t));
    }
    if (excess <= 1 || 2 * seconds > arguments.seconds) break;
    seconds_before = seconds;
    excess_before = excess;
  }
}

// Runs in a process of its own (MegabytesOfOtherProcess).
double MegabytesOfTracing(const Arguments& arguments) {
  const auto& [samples, frames] = *arguments.memory_of;
  const Subject subject(SceneWith(
      arguments,
      kEightVertices + kTexture + kCoat + Settings{fmt::format("trajectory.frames={}", kMostFrames)}, 3));
  const Image8& valid = subject.setup.valid();
  const double film = 3.0 * sizeof(float) * valid.width * valid.height / kBytesPerMegabyte;
  PathOptions options = subject.scene.path;
  options.samples = samples;
  MovingWall walls(subject.scene.geometry, {std::nullopt, true});
  walls.At(0);
  return MegabytesBeyondBefore([&] {
           for (int frame = 0; frame < frames; ++frame) {
             FrameSetup(subject.scene, &walls, frame, 0).Trace(options, 1);
           }
         }) -
         film;
}

void Memory(const Arguments& arguments) {
  fmt::print("\nmemory beyond scene, its tree of boxes and film, three guides, texture, coat, 8 vertices\n");
  const auto line = [](const std::string& name, double megabytes) {
    fmt::print("  {:<40}{:>8.1f} MB\n", name, megabytes);
  };
  line("(what the measure says of 64 MB)",
       MegabytesBeyondBefore([] { std::vector<char> held(64 * size_t{kBytesPerMegabyte}, 1); }));
  for (const auto& [samples, frames] : {std::pair(1, 1), {8, 1}, {1, kMostFrames}}) {
    line(fmt::format("samples: {}, frames: {}", samples, frames),
         MegabytesOfOtherProcess(
             {arguments.scene.string(), "--memory-of", std::to_string(samples), std::to_string(frames)}));
  }
}

void Threads(const Arguments& arguments) {
  fmt::print("\ntwo threads against one (wall time, best of {} runs)\n", 2 * arguments.runs);
  const std::pair<const char*, Settings> kCases[] = {{"direct light", kTexture},
                                                     {"8 vertices", kTexture + kEightVertices}};
  for (const auto& [name, settings] : kCases) {
    const Subject subject(SceneWith(arguments, settings, 0));
    PathOptions options = subject.scene.path;
    options.samples = options.bounces > 0 ? 4 : 64;
    double best[2] = {1e30, 1e30};
    for (int run = 0; run < 2 * arguments.runs; ++run) {
      for (int threads : {1, 2}) {
        SetThreadCount(threads);
        const double start = WallSeconds();
        subject.setup.Trace(options, 1);
        best[threads - 1] = std::min(best[threads - 1], WallSeconds() - start);
      }
    }
    SetThreadCount(0);
    fmt::print("  {:<40}{:>8.2f} times\n", name, best[0] / best[1]);
  }
}

void Growth(const Arguments& arguments) {
  fmt::print("\nhow time grows, direct light and 3 bounces\n");
  const auto line = [&](const std::string& name, const Settings& settings, int samples, double& last) {
    const Subject subject(SceneWith(arguments, settings + kTexture, 0));
    PathOptions direct = subject.scene.path;
    direct.samples = samples;
    PathOptions bounced = direct;
    bounced.bounces = 3;
    PathCount count;
    const double seconds = CpuSecondsOfFrame(subject, direct, arguments.runs, &count);
    const double bounced_seconds = CpuSecondsOfFrame(subject, bounced, 1, nullptr);
    const double each = static_cast<double>(count.samples);
    fmt::print("  {:<40}{:>8.3f} CPU-s {:>7.1f} ns a sample{:>9.3f} CPU-s {:>7.1f} ns\n", name, seconds,
               1e9 * seconds / each, bounced_seconds, 1e9 * bounced_seconds / each);
    last = bounced_seconds;
  };
  double last = 0;
  for (const auto& [width, height] :
       {std::pair(169, 135), {338, 270}, {675, 540}, {1350, 1080}, {2700, 2160}}) {
    line(fmt::format("{}x{} pixels", width, height),
         {fmt::format("camera.width={}", width), fmt::format("camera.height={}", height)}, 2, last);
  }
  for (int samples : {1, 4, 16, 64}) {
    line(fmt::format("{} samples", samples), {}, samples, last);
    if (4 * last > arguments.seconds) break;
  }
  // The wall's tolerance and its number of triangles are inverse to each other.
  const double finest = arguments.large ? 0.0006 : 0.0035;
  for (double tolerance_mm : {0.3, 0.06, 0.015, 0.0035, 0.0006}) {
    if (tolerance_mm < finest) break;
    const Settings fine = {fmt::format("geometry.tolerance_mm={}", tolerance_mm)};
    line(fmt::format("{} triangles", SceneWith(arguments, fine, 0).geometry.mesh.faces.size()), fine, 4,
         last);
  }
}

// By the names that --only takes.
const std::pair<const char*, void (*)(const Arguments&)> kSections[] = {
    {"rays", Rays},     {"noise", Noise},     {"frame", WholeFrame},
    {"memory", Memory}, {"threads", Threads}, {"growth", Growth}};

void Run(const Arguments& arguments) {
  SetQuiet(true);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  if (arguments.memory_of) return fmt::print("{}\n", MegabytesOfTracing(arguments));
  fmt::print("{} threads\n", ThreadCount());
  for (const auto& [name, section] : kSections) {
    if (arguments.only.empty() || arguments.only == name) section(arguments);
  }
}

}  // namespace
}  // namespace lumen

int main(int argc, char** argv) {
  CLI::App app{"Measures the path tracer's speed.", "lumen_bench_render"};
  lumen::Arguments arguments;
  app.add_option("scene", arguments.scene, "the scene to vary (default: scenes/bench/colon.toml)");
  app.add_option("--seconds", arguments.seconds, "CPU seconds that one render may take (default: 60)");
  app.add_option("--runs", arguments.runs, "of which the median counts (default: 3)");
  app.add_flag("--large", arguments.large, "up to five million triangles");
  std::vector<std::string> sections;
  for (const auto& section : lumen::kSections) sections.push_back(section.first);
  app.add_option("--only", arguments.only, "measures one thing (default: all)")
      ->check(CLI::IsMember(sections));
  app.add_option("--memory-of", arguments.memory_of)->group("");  // what the benchmark calls itself with
  CLI11_PARSE(app, argc, argv);
  try {
    lumen::Run(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "lumen_bench_render: {}\n", error.what());
    return 1;
  }
  return 0;
}
