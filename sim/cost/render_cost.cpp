#include "sim/cost/render_cost.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/progress.h"
#include "common/random.h"
#include "sim/cost/frame_setup.h"
#include "sim/cost/knobs.h"
#include "sim/cost/reference.h"
#include "sim/cost/timing.h"

namespace lumen {
namespace {

// Parts of the time that is given, and how many times a curve's samples a reference has at least.
constexpr double kReferenceShare = 0.22, kCurvesShare = 0.1, kEffectsShare = 0.1;
constexpr int kReferenceAhead = 8;
constexpr int kLongestReference = 1 << 16;  // samples
constexpr int kAllBounces = 64;  // stands for all: what is left of light behind them, 0.8^64, is 1e-6

class CostMeasurement {
 public:
  CostMeasurement(const Scene& scene, const RenderCostOptions& options)
      : scene_(scene),
        options_(options),
        walls_(scene.geometry, {scene.peristalsis, scene.surface.coat.has_value()}),
        setup_(scene, &walls_, options.frame, options.seed),
        progress_("cost"),
        start_(WallSeconds()) {}

  RenderCost Run() {
    result_.width = scene_.calibration.camera.width;
    result_.height = scene_.calibration.camera.height;
    result_.triangles = static_cast<int>(scene_.geometry.mesh.faces.size());
    setup_.Trace(scene_.path, options_.seed);  // fills caches
    std::vector<Knob> own, biased;
    for (Knob& knob : KnobsOf(scene_)) (knob.biased ? biased : own).push_back(std::move(knob));
    MeasureKnobs(own, scene_.path, kReferenceShare, &result_.sampling_reference, &result_.sampling);
    PathOptions all_light = scene_.path;
    all_light.bounces = kAllBounces;
    MeasureKnobs(biased, all_light, kReferenceShare, &result_.transport_reference, &result_.transport);
    MeasureEffects();
    return std::move(result_);
  }

 private:
  // Both halves together last about `share` of the time.
  Reference Converge(PathOptions options, double share, CostReference* about) {
    options.samples = scene_.path.samples;
    const auto start = WallSeconds();
    setup_.Trace(options, Seed(1000));
    const double a_sample = (WallSeconds() - start) / options.samples;
    const double half = share * options_.seconds / 2 / a_sample;
    options.samples = static_cast<int>(std::clamp(half, 8.0, double(kLongestReference) / 2));
    about->samples = 2 * options.samples;
    about->bounces = options.bounces;
    Luminance first = Measure(options, Seed(1001));
    Update();
    Reference reference(std::move(first), Measure(options, Seed(1002)));
    Update();
    for (ErrorMeasure measure : kErrorMeasures) about->noise.push_back(reference.Noise(measure));
    about->mean_error = reference.MeanError();
    return reference;
  }

  void MeasureKnobs(const std::vector<Knob>& knobs, const PathOptions& converged, double share,
                    CostReference* about, CostCurves* curves) {
    curves->measures = {"pixel_error", "block_error"};
    const Reference reference = Converge(converged, share, about);
    for (const Knob& knob : knobs) {
      CostCurve curve{knob.name, {}};
      const auto start = WallSeconds();
      const double limit = kCurvesShare * options_.seconds;
      double longest = 0;  // seconds a unit of work that settings of this knob took
      for (const KnobSetting& setting : knob.settings) {
        if (!knob.biased && setting.options.samples * kReferenceAhead > about->samples) break;
        const double expected = longest * setting.work * options_.runs;
        if (WallSeconds() - start + expected > limit) break;
        const auto setting_start = WallSeconds();
        curve.points.push_back(MeasureSetting(knob.name, setting, reference));
        longest = (WallSeconds() - setting_start) / options_.runs / setting.work;
        Update();
      }
      curves->curves.push_back(std::move(curve));
    }
  }

  CostPoint MeasureSetting(const std::string& knob, const KnobSetting& setting, const Reference& reference) {
    std::vector<double> seconds;
    std::vector<Luminance> runs;
    for (int run = 0; run < options_.runs; ++run) {
      ImageF radiance;
      seconds.push_back(CpuSecondsOf([&] { radiance = Trace(setting, Seed(run)); }));
      runs.push_back(LuminanceOf(radiance, setup_.valid()));
    }
    CostPoint point;
    point.setting = setting.label;
    point.seconds = MedianOf(seconds);
    point.seconds_spread = HalfRange(seconds);
    point.is_default = setting.is_own;
    for (ErrorMeasure measure : kErrorMeasures) {
      std::vector<double> errors;
      double squares = 0;
      for (const Luminance& run : runs) {
        errors.push_back(reference.Error(run, measure));
        squares += errors.back() * errors.back() / options_.runs;
      }
      point.errors.push_back(std::sqrt(squares));
      point.error_spreads.push_back(HalfRange(errors));
    }
    result_.biases.push_back({knob, setting.label, reference.BiasOf(runs)});
    return point;
  }

  // With and without take turns, so that a machine that slows down slows both.
  void MeasureEffects() {
    std::vector<double> whole;
    for (const EffectSwitch& effect : SwitchesOf(scene_)) {
      Scene without = scene_;
      effect.switch_off(&without);
      const FrameSetup setup(without, &walls_, options_.frame, options_.seed);
      const auto start = WallSeconds();
      std::vector<double> on, off;
      // Short frames are taken oftener: their clock is coarser.
      const double limit = kEffectsShare * options_.seconds / static_cast<double>(scene_.effects.size());
      for (int run = 0; run < options_.runs || (run < 5 * options_.runs && WallSeconds() - start < limit);
           ++run) {
        on.push_back(CpuSecondsOf([&] { setup_.Take(Seed(run)); }));
        off.push_back(CpuSecondsOf([&] { setup.Take(Seed(run)); }));
      }
      result_.effects.push_back(
          {effect.name, MedianOf(on) - MedianOf(off), std::hypot(MedianError(on), MedianError(off))});
      whole.insert(whole.end(), on.begin(), on.end());
      Update();
    }
    for (int run = 0; whole.size() < size_t(options_.runs); ++run) {
      whole.push_back(CpuSecondsOf([&] { setup_.Take(Seed(run)); }));
    }
    result_.frame_seconds = MedianOf(whole);
    result_.frame_seconds_error = MedianError(whole);
    if (walls_.moves()) MeasureMovingWall();
  }

  // A wall that moves is built anew for every frame, and again as it moves while the frame is taken. That
  // rays at it then cost more is the shutter's.
  void MeasureMovingWall() {
    std::vector<double> seconds;
    for (int run = 0; run < options_.runs; ++run) {
      seconds.push_back(CpuSecondsOf([&] {
        walls_.At(options_.frame + 1 + run);
        if (scene_.sensor.shutter) walls_.During(options_.frame, scene_.sensor.shutter->Duration());
      }));
    }
    result_.effects.push_back({"peristalsis", MedianOf(seconds), MedianError(seconds)});
    result_.frame_seconds += MedianOf(seconds);
    result_.frame_seconds_error = std::hypot(result_.frame_seconds_error, MedianError(seconds));
  }

  ImageF Trace(const KnobSetting& setting, uint64_t seed) const {
    switch (setting.tracer) {
      case PathTracer::kSingleFloat:
        return setup_.TracePlainly<float>(setting.options, seed);
      case PathTracer::kSingleDouble:
        return setup_.TracePlainly<double>(setting.options, seed);
      case PathTracer::kPackets:
        break;
    }
    return setup_.Trace(setting.options, seed);
  }

  Luminance Measure(const PathOptions& options, uint64_t seed) const {
    return LuminanceOf(setup_.Trace(options, seed), setup_.valid());
  }

  uint64_t Seed(uint64_t run) const { return RandomBits(options_.seed, 0x636f7374ull, run); }

  void Update() { progress_.Update(std::min(0.99, (WallSeconds() - start_) / options_.seconds)); }

  const Scene& scene_;
  const RenderCostOptions& options_;
  MovingWall walls_;
  FrameSetup setup_;
  Progress progress_;
  double start_;
  RenderCost result_;
};

}  // namespace

RenderCost MeasureRenderCost(const Scene& scene, const RenderCostOptions& options) {
  const int frames = static_cast<int>(scene.world_from_camera.size());
  if (options.frame < 0 || options.frame >= frames) {
    throw InputError("--frame " + std::to_string(options.frame) + ": the scene has frames 0 to " +
                     std::to_string(frames - 1));
  }
  return CostMeasurement(scene, options).Run();
}

}  // namespace lumen
