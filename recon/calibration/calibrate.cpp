#include "recon/calibration/calibrate.h"

#include <array>
#include <cmath>

#include "common/error.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "common/statistics.h"
#include "recon/calibration/bounced_light.h"

namespace lumen {
namespace {

class Calibrator {
 public:
  Calibrator(const Sequence& sequence, const CalibrateOptions& options, const QuickSurface& surface,
             uint64_t seed)
      : sequence_(sequence), options_(options), scene_(surface.mesh) {
    sightings_ = FindSightings(sequence, scene_, options.sightings, seed);
  }

  SequenceCalibration Go() {
    SequenceCalibration result;
    Progress progress("gains");
    result.fit = FitGains(sequence_, sightings_, {}, options_.fit);
    const Eigen::MatrixXf factors = FormFactors(scene_, sightings_);
    for (int round = 0; round < options_.rounds; ++round) {
      progress.Update(double(round) / options_.rounds);
      bounced_.clear();
      for (int c = 0; c < 3; ++c) bounced_.push_back(BouncedLight(factors, sightings_, result.fit.wall, c));
      result.fit = FitGains(sequence_, sightings_, bounced_, options_.fit, &result.fit);
    }
    EstimateLight(&result);
    EstimateGains(&result);
    return result;
  }

 private:
  // Near and far, shallow and steep, red and the other channels of what the fit uses. An error of the
  // surface, or of the light that the model supposes, tells differently on them: between walls red goes to
  // and fro most.
  std::vector<GainFitOptions> Halves(const GainFitOptions& whole) const {
    std::vector<double> distances, cosines;
    for (Eigen::Index i = 0; i < sightings_.view_cosine.size(); ++i) {
      const double cosine = sightings_.view_cosine.data()[i];
      if (cosine < whole.cosine.low) continue;
      distances.push_back(sightings_.distance_mm.data()[i]);
      cosines.push_back(cosine);
    }
    const double distance = MedianOf(std::move(distances)), cosine = MedianOf(std::move(cosines));
    std::vector<GainFitOptions> halves(6, whole);
    halves[0].distance_mm.high = halves[1].distance_mm.low = distance;
    halves[2].cosine.high = halves[3].cosine.low = cosine;
    halves[4].channels = {true, false, false};
    halves[5].channels = {false, true, true};
    for (GainFitOptions& half : halves) half.min_places = 2;
    return halves;
  }

  std::vector<GainFit> FitHalves(const GainFitOptions& options, const GainFit& whole) const {
    const std::vector<GainFitOptions> halves = Halves(options);
    std::vector<GainFit> fits(halves.size());
    ParallelFor(0, static_cast<int64_t>(halves.size()),
                [&](int64_t i) { fits[i] = FitHalf(halves[i], whole); });
    return fits;
  }

  // The fit of a half, or the whole's where frames of it are left without company.
  GainFit FitHalf(const GainFitOptions& half, const GainFit& whole) const {
    try {
      return FitGains(sequence_, sightings_, bounced_, half, &whole);
    } catch (const InputError&) {
      return whole;
    }
  }

  // Spread and γ together, gains left free.
  void EstimateLight(SequenceCalibration* result) const {
    GainFitOptions options = options_.fit;
    options.spread = true;
    options.contrast = !sequence_.calibration.response.srgb;
    const auto spread_and_gamma = [&](const GainFit& fit) {
      return std::array<Estimate, 2>{SpreadOf(fit), GammaOf(fit)};
    };
    const GainFit whole = FitHalf(options, result->fit);
    std::array<Estimate, 2> found = spread_and_gamma(whole);
    std::array<double, 2> variance{};
    const std::vector<GainFit> halves = FitHalves(options, whole);
    for (size_t i = 0; i < halves.size(); i += 2) {
      const auto one = spread_and_gamma(halves[i]), other = spread_and_gamma(halves[i + 1]);
      for (int k = 0; k < 2; ++k) variance[k] += std::pow((one[k].value - other[k].value) / 2, 2);
    }
    for (int k = 0; k < 2; ++k)
      found[k].standard_error = std::hypot(found[k].standard_error, std::sqrt(variance[k]));
    const auto tells = [&](const Estimate& estimate) {
      return estimate.value > 0 && estimate.standard_error <= options_.tells_within * estimate.value;
    };
    result->spread = found[0];
    result->gamma = found[1];
    result->tells_spread = tells(result->spread);
    result->tells_gamma = options.contrast && tells(result->gamma);
  }

  void EstimateGains(SequenceCalibration* result) const {
    GainFitOptions options = options_.fit;
    options.spread = options_.light && result->tells_spread;
    options.contrast = options_.light && result->tells_gamma;
    if (options.spread || options.contrast) {
      result->fit = FitHalf(options, result->fit);
      if (options.spread) result->spread.value = SpreadOf(result->fit).value;
      if (options.contrast) result->gamma.value = GammaOf(result->fit).value;
    }
    const Eigen::VectorXd& gains = result->fit.wall.log_gain;
    if (!gains.allFinite()) {
      throw InputError(sequence_.folder.string() +
                       ": the places that frames share don't tell their gains; check poses and light");
    }
    Eigen::VectorXd variance = result->fit.log_gain_error.array().square();
    const std::vector<GainFit> halves = FitHalves(options, result->fit);
    for (size_t i = 0; i < halves.size(); i += 2) {
      const Eigen::VectorXd difference = halves[i].wall.log_gain - halves[i + 1].wall.log_gain;
      variance.array() += difference.array().square() / 4;
    }
    for (Eigen::Index f = 0; f < gains.size(); ++f)
      result->log_gain.push_back({gains[f], std::sqrt(variance[f])});
  }

  Estimate SpreadOf(const GainFit& fit) const {
    double spread = 0;
    const auto& sources = sequence_.calibration.light.sources;
    for (const LightSource& source : sources) spread += source.spread / static_cast<double>(sources.size());
    return {spread + fit.spread_off, fit.spread_error};
  }

  // Values are as if developed with the sequence's γ; a light whose logarithm shows `contrast` times as much
  // was developed with another one.
  Estimate GammaOf(const GainFit& fit) const {
    const double gamma = sequence_.calibration.response.gamma;
    return {gamma / fit.contrast, gamma * fit.contrast_error / (fit.contrast * fit.contrast)};
  }

  const Sequence& sequence_;
  const CalibrateOptions& options_;
  RayScene scene_;
  Sightings sightings_;
  std::vector<Eigen::ArrayXXf> bounced_;
};

}  // namespace

SequenceCalibration Calibrate(const Sequence& sequence, const CalibrateOptions& options, uint64_t seed) {
  if (sequence.frames.size() < 2) {
    throw InputError(sequence.folder.string() +
                     ": has one frame; gains are told by places that several share");
  }
  const QuickSurface surface = LearnQuickSurface(sequence, options.surface, seed);
  SequenceCalibration result = Calibrator(sequence, options, surface, seed).Go();
  result.learnt_frames = surface.frames;
  result.learnt_log_gain = surface.log_gain;
  return result;
}

}  // namespace lumen
