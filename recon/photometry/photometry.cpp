#include "recon/photometry/photometry.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "common/error.h"
#include "common/parallel.h"

namespace lumen {
namespace {

constexpr double kDegrees = 180 / kPi;
constexpr int kFactorBins = 30;

// Sums of y over the bins of x, within each cell and over all.
class Binner {
 public:
  explicit Binner(std::vector<double> edges) : edges_(std::move(edges)), sums_(edges_.size() - 1) {}

  void Add(double x, double y) {
    const auto above = std::upper_bound(edges_.begin(), edges_.end(), x);
    if (above == edges_.begin() || above == edges_.end()) return;
    Sums& bin = sums_[above - edges_.begin() - 1];
    bin.cell_count += 1;
    bin.cell_sum += y;
    bin.squares += y * y;
    bin.places += x;
  }

  void EndCell() {
    for (Sums& bin : sums_) {
      bin.count += bin.cell_count;
      bin.sum += bin.cell_sum;
      bin.count_count += bin.cell_count * bin.cell_count;
      bin.count_sum += bin.cell_count * bin.cell_sum;
      bin.sum_sum += bin.cell_sum * bin.cell_sum;
      bin.cell_count = bin.cell_sum = 0;
    }
  }

  void Add(const Binner& other) {
    for (size_t i = 0; i < sums_.size(); ++i) {
      Sums& bin = sums_[i];
      const Sums& more = other.sums_[i];
      bin.count += more.count;
      bin.sum += more.sum;
      bin.squares += more.squares;
      bin.places += more.places;
      bin.count_count += more.count_count;
      bin.count_sum += more.count_sum;
      bin.sum_sum += more.sum_sum;
    }
  }

  // Those that aren't empty. The mean is a ratio of sums over cells: its error is √Σ_k (S_k − mean · n_k)² /
  // n.
  std::vector<Bin> Bins() const {
    std::vector<Bin> bins;
    for (size_t i = 0; i < sums_.size(); ++i) {
      const Sums& sums = sums_[i];
      if (sums.count == 0) continue;
      const double mean = sums.sum / sums.count;
      const double scatter = sums.sum_sum - 2 * mean * sums.count_sum + mean * mean * sums.count_count;
      // Rounding may leave a sum of squares that is 0 a little below it.
      bins.push_back({edges_[i], edges_[i + 1], static_cast<int64_t>(sums.count), mean,
                      std::sqrt(std::max(scatter, 0.0)) / sums.count, std::sqrt(sums.squares / sums.count),
                      sums.places / sums.count});
    }
    return bins;
  }

 private:
  struct Sums {
    double count = 0, sum = 0, squares = 0, places = 0;  // n, Σ y, Σ y², Σ x
    double count_count = 0, count_sum = 0, sum_sum = 0;  // Σ over cells of n², n·S, S²
    double cell_count = 0, cell_sum = 0;                 // of the cell that is being added
  };
  std::vector<double> edges_;
  std::vector<Sums> sums_;
};

std::vector<double> EvenEdges(double from, double to, int bins) {
  std::vector<double> edges;
  for (int i = 0; i <= bins; ++i) edges.push_back(from + (to - from) * i / bins);
  return edges;
}

struct Binners {
  Binner distance{{0, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150}};
  Binner angle{EvenEdges(0, 90, 9)};
  Binner factor_t{EvenEdges(std::log(1.0), std::log(150.0), kFactorBins)};
  Binner factor_cos{EvenEdges(std::log(0.05), 1e-6, kFactorBins)};  // the last one takes cos = 1 in
  Binner factor_axis{EvenEdges(0, 1.5, kFactorBins)};

  std::array<Binner*, 5> all() { return {&distance, &angle, &factor_t, &factor_cos, &factor_axis}; }

  void Add(const Pattern& pattern, const ParameterValues& values, double residual) {
    const double cos = std::exp(pattern.by_cos);
    distance.Add(std::exp(pattern.by_t), residual);
    angle.Add(std::acos(std::min(cos, 1.0)) * kDegrees, residual);
    factor_t.Add(pattern.by_t, residual + values[int(Parameter::kTExponent)] * pattern.by_t);
    factor_cos.Add(pattern.by_cos, residual + values[int(Parameter::kCosExponent)] * pattern.by_cos);
    factor_axis.Add(-pattern.by_spread, residual + values[int(Parameter::kSpread)] * pattern.by_spread);
  }
};

void FillBins(const Observations& observations, Photometry* result) {
  constexpr int64_t kGrain = 16;
  std::vector<Binners> parts((observations.cells() + kGrain - 1) / kGrain);
  const Fit& fit = result->all;
  ParallelChunks(0, observations.cells(), kGrain, [&](int64_t first, int64_t last) {
    Binners& part = parts[first / kGrain];
    for (int64_t cell = first; cell < last; ++cell) {
      for (int64_t pixel = observations.cell_begin[cell]; pixel < observations.cell_begin[cell + 1];
           ++pixel) {
        for (int channel : result->channels) {
          const float residual = fit.residuals[pixel * 3 + channel];
          if (std::isnan(residual)) continue;  // not used in this channel
          part.Add(PatternAt(observations, pixel, channel, fit.values), fit.values, residual);
        }
      }
      for (Binner* binner : part.all()) binner->EndCell();
    }
  });
  Binners sum;
  for (Binners& part : parts) {
    for (size_t i = 0; i < sum.all().size(); ++i) sum.all()[i]->Add(*part.all()[i]);
  }
  result->by_distance = sum.distance.Bins();
  result->by_angle = sum.angle.Bins();
  result->factor_t = sum.factor_t.Bins();
  result->factor_cos = sum.factor_cos.Bins();
  result->factor_axis = sum.factor_axis.Bins();
}

std::vector<int> UsableChannels(const Observations& observations, int min_cells) {
  std::vector<int> channels;
  for (int channel = 0; channel < 3; ++channel) {
    int cells = 0;
    for (int cell = 0; cell < observations.cells(); ++cell) {
      const auto begin = observations.code.begin() + observations.cell_begin[cell];
      const auto end = observations.code.begin() + observations.cell_begin[cell + 1];
      cells += std::any_of(begin, end, [&](const auto& code) { return code[channel] != 0; });
    }
    if (cells >= min_cells) channels.push_back(channel);
  }
  return channels;
}

// The true γ where a power of `assumed` was undone and `contrast` is what was left: γ = assumed/contrast.
Figure GammaFigure(const std::string& name, const Fit& fit, Parameter contrast, double assumed) {
  const double value = assumed / fit.values[int(contrast)];
  return {name, value, value / fit.values[int(contrast)] * fit.standard_error[int(contrast)], assumed};
}

bool GainsTell(const Observations& observations) {
  double low = 0, high = 0;
  for (size_t i = 0; i < observations.frames.size(); ++i) {
    const auto& gain = observations.sequence->frames[observations.frames[i]].gain;
    if (!gain) return false;
    low = i == 0 ? std::log(*gain) : std::min(low, std::log(*gain));
    high = i == 0 ? std::log(*gain) : std::max(high, std::log(*gain));
  }
  return high - low > 1e-3;  // less is below what a step of a code does even at 254
}

void AddModel(const std::string& prefix, const Fit& fit, double spread, std::vector<Figure>* figures) {
  const auto add = [&](const char* name, Parameter parameter, double expected) {
    figures->push_back(
        {prefix + name, fit.values[int(parameter)], fit.standard_error[int(parameter)], expected});
  };
  add("t_exponent", Parameter::kTExponent, -2);
  add("cos_exponent", Parameter::kCosExponent, 1);
  add("spread", Parameter::kSpread, spread);
  figures->push_back({prefix + "r_squared", fit.r_squared, fit.r_squared_error, {}});
  figures->push_back({prefix + "residual", fit.residual, fit.residual_error, {}});
}

void AddGamma(const Observations& observations, Photometry* result) {
  const Response& response = observations.sequence->calibration.response;
  if (response.srgb) return;
  FitOptions options;
  options.channels = result->channels;
  options.free = {Parameter::kSpread, Parameter::kContrast};
  result->figures.push_back(
      GammaFigure("gamma", FitModel(observations, options), Parameter::kContrast, response.gamma));
  if (!GainsTell(observations)) return;
  options.free = {Parameter::kTExponent, Parameter::kCosExponent, Parameter::kSpread,
                  Parameter::kGainExponent};
  options.known_gains = true;
  result->figures.push_back(GammaFigure("gamma_from_gains", FitModel(observations, options),
                                        Parameter::kGainExponent, response.gamma));
}

void AddGains(const Observations& observations, Photometry* result) {
  if (observations.frames.size() < 2) return;  // about their mean there is nothing to say of one
  double mean = 0;
  bool known = true;
  for (int index : observations.frames) {
    const auto& gain = observations.sequence->frames[index].gain;
    known = known && gain;
    if (gain) mean += std::log(*gain) / static_cast<double>(observations.frames.size());
  }
  for (size_t i = 0; i < observations.frames.size(); ++i) {
    const SequenceFrame& frame = observations.sequence->frames[observations.frames[i]];
    Figure figure = {
        GainFigureName(frame.number), result->all.log_gain[i], result->all.log_gain_error[i], {}};
    if (known) figure.expected = std::log(*frame.gain) - mean;
    result->figures.push_back(figure);
  }
}

void AddBins(const std::string& prefix, const std::vector<Bin>& bins, std::vector<Figure>* figures) {
  for (const Bin& bin : bins) {
    char range[64];
    std::snprintf(range, sizeof(range), "%g-%g", bin.from, bin.to);
    figures->push_back({prefix + range, bin.mean, bin.standard_error, 0.0});
  }
}

}  // namespace

const Figure* Photometry::Find(const std::string& name) const {
  const auto found =
      std::find_if(figures.begin(), figures.end(), [&](const Figure& figure) { return figure.name == name; });
  return found == figures.end() ? nullptr : &*found;
}

const char* ChannelName(int channel) {
  constexpr const char* kNames[] = {"red", "green", "blue"};
  return kNames[channel];
}

std::string GainFigureName(int frame_number) {
  char name[32];
  std::snprintf(name, sizeof(name), "log_gain.%04d", frame_number);
  return name;
}

Photometry FitPhotometry(const Observations& observations, const PhotometryOptions& options) {
  Photometry result;
  const Sequence& sequence = *observations.sequence;
  for (int index : observations.frames) result.frame_numbers.push_back(sequence.frames[index].number);
  for (int index : observations.left_out) result.left_out.push_back(sequence.frames[index].number);
  result.channels = UsableChannels(observations, options.min_cells);
  if (result.channels.empty()) {
    throw InputError(sequence.folder.string() +
                     ": in no channel are there places enough that are neither black nor saturated");
  }
  FitOptions fit_options;
  fit_options.channels = result.channels;
  result.all = FitModel(observations, fit_options);
  const double spread = NominalParameters(sequence.calibration)[int(Parameter::kSpread)];
  AddModel("", result.all, spread, &result.figures);
  AddGamma(observations, &result);
  for (int channel : result.channels) {
    fit_options.channels = {channel};
    result.by_channel.push_back(FitModel(observations, fit_options));
    AddModel(std::string(ChannelName(channel)) + ".", result.by_channel.back(), spread, &result.figures);
  }
  AddGains(observations, &result);
  FillBins(observations, &result);
  AddBins("residual_by_distance_mm.", result.by_distance, &result.figures);
  AddBins("residual_by_angle_deg.", result.by_angle, &result.figures);
  return result;
}

}  // namespace lumen
