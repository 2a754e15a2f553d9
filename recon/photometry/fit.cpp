#include "recon/photometry/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"
#include "common/parallel.h"

namespace lumen {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int64_t kGrain = 16384;
constexpr int kMaxDense = kParameters + 2;  // and the offsets of two channels from the first

double MeanSpread(const Light& light) {
  double sum = 0;
  for (const LightSource& source : light.sources) sum += source.spread;
  return sum / static_cast<double>(light.sources.size());
}

// One equation: value = prediction + row · (what the parameters are off by) + residual. Dense columns, then
// one of the intercepts.
struct Equation {
  double residual;
  std::array<double, kMaxDense> row;
  int intercept;
};

class Problem {
 public:
  Problem(const Observations& observations, const FitOptions& options)
      : observations_(observations),
        options_(options),
        values_(NominalParameters(observations.sequence->calibration)),
        dense_(static_cast<int>(options.free.size() + options.channels.size()) - 1),
        intercepts_(options.known_gains ? 1 : static_cast<int>(observations.frames.size())),
        offsets_(VectorXd::Zero(dense_ - static_cast<int>(options.free.size()) + intercepts_)) {
    const Response& response = observations.sequence->calibration.response;
    // The mean shift of a logarithm by rounding, undone (PhotometryOptions::min_code); a decoded value goes
    // as a power of the code whose exponent is that of the response there.
    for (int code = 1; code < 256; ++code) {
      const double linear = Decode(response, code / 255.0);
      const double exponent = code / 255.0 / (linear * EncodeDerivative(response, linear));
      log_decoded_[code] = std::log(linear) + exponent / (24.0 * code * code);
    }
    for (int index : observations.frames) {
      const auto& gain = observations.sequence->frames[index].gain;
      log_known_gain_.push_back(gain ? std::log(*gain) : 0);
    }
    // About their mean, so that the gain's column has nothing in common with the intercept's.
    const double mean = Eigen::Map<const VectorXd>(log_known_gain_.data(), log_known_gain_.size()).mean();
    for (double& gain : log_known_gain_) gain -= mean;
  }

  int dense() const { return dense_; }
  int intercepts() const { return intercepts_; }
  int columns() const { return dense_ + intercepts_; }
  const ParameterValues& values() const { return values_; }
  const VectorXd& offsets() const { return offsets_; }
  double log_decoded(uint8_t code) const { return log_decoded_[code]; }

  // False where the pixel can't be used in the channel (the k-th of the fit's).
  bool EquationOf(int64_t pixel, int k, Equation* equation) const {
    const int channel = options_.channels[k];
    const uint8_t code = observations_.code[pixel][channel];
    if (code == 0) return false;
    const Pattern pattern = PatternAt(observations_, pixel, channel, values_);
    const double contrast = Value(Parameter::kContrast);
    const int free = static_cast<int>(options_.free.size());
    const double gain = options_.known_gains ? log_known_gain_[observations_.frame[pixel]] : 0;
    double prediction = contrast * pattern.log_sum + Value(Parameter::kGainExponent) * gain;
    for (int i = 0; i < free; ++i) {
      switch (options_.free[i]) {
        case Parameter::kTExponent:
          equation->row[i] = contrast * pattern.by_t;
          break;
        case Parameter::kCosExponent:
          equation->row[i] = contrast * pattern.by_cos;
          break;
        case Parameter::kSpread:
          equation->row[i] = contrast * pattern.by_spread;
          break;
        case Parameter::kContrast:
          equation->row[i] = pattern.log_sum;
          break;
        case Parameter::kGainExponent:
          equation->row[i] = gain;
          break;
      }
    }
    for (int i = free; i < dense_; ++i) equation->row[i] = i - free == k - 1 ? 1 : 0;
    if (k > 0) prediction += offsets_[k - 1];
    equation->intercept = options_.known_gains ? 0 : observations_.frame[pixel];
    prediction += offsets_[dense_ - free + equation->intercept];
    equation->residual = log_decoded_[code] - prediction;
    return true;
  }

  // Moves all parameters; the answer is by how much at most one of the free ones moves.
  double Move(const VectorXd& step) {
    const int free = static_cast<int>(options_.free.size());
    for (int i = 0; i < free; ++i) values_[static_cast<int>(options_.free[i])] += step[i];
    offsets_ += step.tail(offsets_.size());
    return free > 0 ? step.head(free).cwiseAbs().maxCoeff() : 0;
  }

 private:
  double Value(Parameter parameter) const { return values_[static_cast<int>(parameter)]; }

  const Observations& observations_;
  const FitOptions& options_;
  ParameterValues values_;
  int dense_, intercepts_;
  VectorXd offsets_;  // of channels after the first, then the intercepts
  std::array<double, 256> log_decoded_{};
  std::vector<double> log_known_gain_;
};

// XᵀX and Xᵀe. Rows have one of the intercepts each, so their block is a diagonal.
struct Normal {
  MatrixXd dense, cross;  // cross: dense columns by intercepts
  VectorXd diagonal, right_dense, right_intercept;
  int64_t count = 0;

  Normal(int columns, int intercepts)
      : dense(MatrixXd::Zero(columns, columns)),
        cross(MatrixXd::Zero(columns, intercepts)),
        diagonal(VectorXd::Zero(intercepts)),
        right_dense(VectorXd::Zero(columns)),
        right_intercept(VectorXd::Zero(intercepts)) {}

  void Add(const Equation& equation) {
    const auto row = Eigen::Map<const VectorXd>(equation.row.data(), dense.rows());
    dense.noalias() += row * row.transpose();
    cross.col(equation.intercept) += row;
    diagonal[equation.intercept] += 1;
    right_dense += equation.residual * row;
    right_intercept[equation.intercept] += equation.residual;
    ++count;
  }

  void Add(const Normal& other) {
    dense += other.dense;
    cross += other.cross;
    diagonal += other.diagonal;
    right_dense += other.right_dense;
    right_intercept += other.right_intercept;
    count += other.count;
  }

  MatrixXd Whole() const {
    const Eigen::Index k = dense.rows(), f = diagonal.size();
    MatrixXd whole = MatrixXd::Zero(k + f, k + f);
    whole.topLeftCorner(k, k) = dense;
    whole.topRightCorner(k, f) = cross;
    whole.bottomLeftCorner(f, k) = cross.transpose();
    whole.diagonal().tail(f) = diagonal;
    return whole;
  }
};

Normal Accumulate(const Observations& observations, const FitOptions& options, const Problem& problem) {
  const int64_t chunks = (observations.size() + kGrain - 1) / kGrain;
  std::vector<Normal> parts(chunks, Normal(problem.dense(), problem.intercepts()));
  ParallelChunks(0, observations.size(), kGrain, [&](int64_t first, int64_t last) {
    Normal& part = parts[first / kGrain];
    Equation equation;
    for (int64_t pixel = first; pixel < last; ++pixel) {
      for (size_t k = 0; k < options.channels.size(); ++k) {
        if (problem.EquationOf(pixel, static_cast<int>(k), &equation)) part.Add(equation);
      }
    }
  });
  Normal sum(problem.dense(), problem.intercepts());
  for (const Normal& part : parts) sum.Add(part);
  return sum;
}

// The inverse of XᵀX, with its columns brought to length 1 first. A column without an equation (a frame whose
// pixels are all saturated in the only channel of the fit) stays where it is.
MatrixXd Inverse(const Normal& normal, const Observations& observations) {
  MatrixXd whole = normal.Whole();
  VectorXd scale = whole.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    if (scale[i] == 0) scale[i] = whole(i, i) = 1;
  }
  whole = scale.cwiseInverse().asDiagonal() * whole * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(whole);
  // Geometry is kept in float: distances that are all the same scatter by 2^-24 of their logarithm, whose
  // square is 4e-15. A direction 500 times as wide as that (1e-9 = (500 · 2^-24)²) is still no information.
  constexpr double kNothing = 1e-9;
  if (!(solver.eigenvalues().minCoeff() > kNothing)) {
    throw InputError(observations.sequence->folder.string() +
                     ": its pixels can't tell distance, incidence and spread apart; use frames that show the "
                     "wall at more distances and angles");
  }
  const MatrixXd inverse = solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() *
                           solver.eigenvectors().transpose();
  return scale.cwiseInverse().asDiagonal() * inverse * scale.cwiseInverse().asDiagonal();
}

// Sums over cells, for the errors of figures that are sums over pixels.
struct CellSums {
  MatrixXd scores;             // cells by columns: X_kᵀ e_k
  VectorXd squares, baseline;  // Σ e², Σ of the squares about the means of frames and channels
  VectorXd counts;
};

// Means of the frames and channels in log, as a fit without light.
VectorXd MeansWithoutLight(const Observations& observations, const FitOptions& options,
                           const Problem& problem) {
  const int channels = static_cast<int>(options.channels.size());
  const int frames = static_cast<int>(observations.frames.size());
  VectorXd sums = VectorXd::Zero(frames * channels), counts = VectorXd::Zero(frames * channels);
  for (int64_t pixel = 0; pixel < observations.size(); ++pixel) {
    for (int k = 0; k < channels; ++k) {
      const uint8_t code = observations.code[pixel][options.channels[k]];
      if (code == 0) continue;
      sums[observations.frame[pixel] * channels + k] += problem.log_decoded(code);
      counts[observations.frame[pixel] * channels + k] += 1;
    }
  }
  return sums.cwiseQuotient(counts.cwiseMax(1));
}

CellSums SumByCells(const Observations& observations, const FitOptions& options, const Problem& problem,
                    std::vector<float>* residuals) {
  const int channels = static_cast<int>(options.channels.size());
  const VectorXd means = MeansWithoutLight(observations, options, problem);
  CellSums sums = {MatrixXd::Zero(observations.cells(), problem.columns()),
                   VectorXd::Zero(observations.cells()), VectorXd::Zero(observations.cells()),
                   VectorXd::Zero(observations.cells())};
  residuals->assign(size_t(observations.size()) * 3, std::numeric_limits<float>::quiet_NaN());
  ParallelFor(0, observations.cells(), [&](int64_t cell) {
    Equation equation;
    for (int64_t pixel = observations.cell_begin[cell]; pixel < observations.cell_begin[cell + 1]; ++pixel) {
      for (int k = 0; k < channels; ++k) {
        if (!problem.EquationOf(pixel, k, &equation)) continue;
        for (int i = 0; i < problem.dense(); ++i) sums.scores(cell, i) += equation.residual * equation.row[i];
        sums.scores(cell, problem.dense() + equation.intercept) += equation.residual;
        sums.squares[cell] += equation.residual * equation.residual;
        const int channel = options.channels[k];
        const double alone = problem.log_decoded(observations.code[pixel][channel]) -
                             means[observations.frame[pixel] * channels + k];
        sums.baseline[cell] += alone * alone;
        sums.counts[cell] += 1;
        (*residuals)[pixel * 3 + channel] = static_cast<float>(equation.residual);
      }
    }
  });
  return sums;
}

// Residual and R² are ratios of sums over cells, A/B: the error follows from Σ_k (A_k − (A/B) B_k)² / B².
void Summarise(const CellSums& sums, Fit* fit) {
  const double cells = static_cast<double>(sums.squares.size());
  const double correction = cells / (cells - 1);
  const double error = sums.squares.sum(), count = sums.counts.sum(), baseline = sums.baseline.sum();
  const auto ratio_error = [&](const VectorXd& below) {
    const double ratio = error / below.sum();
    return std::sqrt(correction * (sums.squares - ratio * below).squaredNorm()) / below.sum();
  };
  fit->residual = std::sqrt(error / count);
  fit->residual_error = error > 0 ? ratio_error(sums.counts) / (2 * fit->residual) : 0;
  fit->scatter = std::sqrt(baseline / count);
  fit->r_squared = 1 - error / baseline;
  fit->r_squared_error = ratio_error(sums.baseline);
}

}  // namespace

ParameterValues NominalParameters(const Calibration& calibration) {
  return {-2, 1, MeanSpread(calibration.light), 1, 1};
}

Pattern PatternAt(const Observations& observations, int64_t pixel, int channel,
                  const ParameterValues& values) {
  const SourceGeometry* geometry = &observations.geometry[pixel * observations.sources];
  double largest = -std::numeric_limits<double>::infinity();
  double sum = 0;  // in units of the largest part so far
  Pattern pattern{};
  for (int s = 0; s < observations.sources; ++s) {
    const SourceGeometry& source = geometry[s];
    if (!std::isfinite(source.log_cos)) continue;  // the wall faces away: no light
    const SourceConstants& constants = observations.constants[s];
    const double part =
        constants.log_intensity[channel] + values[int(Parameter::kTExponent)] * source.log_distance +
        values[int(Parameter::kCosExponent)] * source.log_cos -
        (values[int(Parameter::kSpread)] + constants.spread_about_mean) * source.one_minus_cos_axis;
    double share = 1;
    if (part > largest) {
      const double rescale = s == 0 ? 0 : std::exp(largest - part);
      sum *= rescale;
      pattern.by_t *= rescale;
      pattern.by_cos *= rescale;
      pattern.by_spread *= rescale;
      largest = part;
    } else {
      share = std::exp(part - largest);
    }
    sum += share;
    pattern.by_t += share * source.log_distance;
    pattern.by_cos += share * source.log_cos;
    pattern.by_spread -= share * source.one_minus_cos_axis;
  }
  pattern.log_sum = largest + std::log(sum) + observations.log_vignetting[pixel];
  pattern.by_t /= sum;
  pattern.by_cos /= sum;
  pattern.by_spread /= sum;
  return pattern;
}

Fit FitModel(const Observations& observations, const FitOptions& options) {
  Problem problem(observations, options);
  constexpr int kMostSteps = 50;
  constexpr double kStill = 1e-8;  // far below any standard error
  MatrixXd inverse;
  for (int step = 0;; ++step) {
    const Normal normal = Accumulate(observations, options, problem);
    inverse = Inverse(normal, observations);
    VectorXd right(problem.columns());
    right << normal.right_dense, normal.right_intercept;
    if (problem.Move(inverse * right) < kStill) break;
    if (step == kMostSteps) {
      throw InputError(observations.sequence->folder.string() +
                       ": the fit of the light's spread finds no minimum; check light and camera");
    }
  }
  Fit fit;
  fit.values = problem.values();
  const CellSums sums = SumByCells(observations, options, problem, &fit.residuals);
  fit.count = static_cast<int64_t>(sums.counts.sum());
  const double cells = observations.cells(), columns = problem.columns();
  const double correction = cells / (cells - 1) * (double(fit.count) - 1) / (double(fit.count) - columns);
  const MatrixXd influence = sums.scores * inverse;  // of each cell on each parameter
  for (size_t i = 0; i < options.free.size(); ++i) {
    fit.standard_error[int(options.free[i])] = std::sqrt(correction) * influence.col(i).norm();
  }
  if (!options.known_gains) {
    const MatrixXd gains = influence.rightCols(problem.intercepts());
    const VectorXd log_gain = problem.offsets().tail(problem.intercepts());
    const VectorXd mean = gains.rowwise().mean();
    for (int f = 0; f < problem.intercepts(); ++f) {
      fit.log_gain.push_back(log_gain[f] - log_gain.mean());
      fit.log_gain_error.push_back(std::sqrt(correction) * (gains.col(f) - mean).norm());
    }
  }
  Summarise(sums, &fit);
  return fit;
}

}  // namespace lumen
