#include "recon/calibration/gain_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "common/error.h"
#include "common/statistics.h"

namespace lumen {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRounds = 12;
constexpr double kTukey = 4.685;      // 95% efficiency for Gaussian residuals (Holland and Welsch 1977)
constexpr double kOfNormal = 1.4826;  // standard deviation over the median of absolute residuals
constexpr int kExtras = 5;            // strength of three channels, spread, contrast
constexpr int kSpread = 3, kContrast = 4;

// What one frame shows of a place in one channel.
struct Row {
  int frame;
  double value;  // log
  double light;  // gain 1, over π
  double by_spread, bounced;
};

// The rows of one place in one channel, which have their albedo in common.
struct Group {
  int place, channel, cell;
  std::vector<Row> rows;
};

// Derivative of a row's prediction: one frame's column, then the extras'.
struct Slope {
  double by_gain;
  std::array<double, kExtras> by_extra;
};

bool In(const Range& range, double value) { return range.low <= value && value <= range.high; }

class Problem {
 public:
  Problem(const Sequence& sequence, const Sightings& sightings, const std::vector<Eigen::ArrayXXf>& bounced,
          const GainFitOptions& options)
      : options_(options), frames_(sightings.frames()) {
    Collect(sightings, bounced);
    RequireOverlap(sequence);
    for (int c = 0; c < 3; ++c) free_[c] = !bounced.empty() && !GroupsOf(c).empty();
    free_[kSpread] = options.spread;
    free_[kContrast] = options.contrast;
  }

  GainFit Solve(const GainFit* start) {
    fit_.wall.log_gain = VectorXd::Zero(frames_);
    if (start != nullptr) fit_ = *start;
    fit_.observations = 0;
    scale_ = 1;  // the first round takes all rows for good
    for (int round = 0; round < kRounds; ++round) {
      Accumulate();
      Step();
    }
    Accumulate();
    Errors();
    return fit_;
  }

  void Responses(int places) {
    fit_.wall.log_response = Eigen::ArrayXXf::Constant(places, 3, std::numeric_limits<float>::quiet_NaN());
    std::vector<bool> counts(places);
    for (const Group& group : groups_) {
      fit_.wall.log_response(group.place, group.channel) = static_cast<float>(MeanResidual(group));
      counts[group.place] = true;
      fit_.observations += static_cast<int64_t>(group.rows.size());
    }
    fit_.places = static_cast<int>(std::count(counts.begin(), counts.end(), true));
  }
  GainFit& fit() { return fit_; }

 private:
  int columns() const { return frames_ + kExtras; }

  std::vector<const Group*> GroupsOf(int channel) const {
    std::vector<const Group*> result;
    for (const Group& group : groups_) {
      if (group.channel == channel) result.push_back(&group);
    }
    return result;
  }

  void Collect(const Sightings& s, const std::vector<Eigen::ArrayXXf>& bounced) {
    std::map<std::array<int, 3>, int> cells;
    for (int place = 0; place < s.count(); ++place) {
      const Vec3d at = s.places[place].point / options_.cell_mm;
      const std::array<int, 3> cube = {int(std::floor(at.x())), int(std::floor(at.y())),
                                       int(std::floor(at.z()))};
      for (int c = 0; c < 3; ++c) {
        if (!options_.channels[c]) continue;
        Group group{place, c, 0, {}};
        for (int f = 0; f < frames_; ++f) {
          if (!std::isfinite(s.value[c](place, f)) || !(s.irradiance(place, f) > 0)) continue;
          const double cosine = std::min<double>(s.view_cosine(place, f), std::exp(s.log_cosine(place, f)));
          if (!In(options_.cosine, cosine) || !In(options_.distance_mm, s.distance_mm(place, f))) continue;
          group.rows.push_back({f, std::log(double(s.value[c](place, f))),
                                double(s.irradiance(place, f)) / kPi, double(s.by_spread(place, f)),
                                bounced.empty() ? 0.0 : double(bounced[c](place, f))});
        }
        if (group.rows.size() < 2) continue;
        group.cell = cells.emplace(cube, int(cells.size())).first->second;
        groups_.push_back(std::move(group));
      }
    }
    cells_ = static_cast<int>(cells.size());
  }

  void RequireOverlap(const Sequence& sequence) const {
    std::vector<int> shared(frames_, 0);
    int last_place = -1;
    std::vector<bool> counted(frames_);
    for (const Group& group : groups_) {
      if (group.place != last_place) counted.assign(frames_, false);
      last_place = group.place;
      for (const Row& row : group.rows) {
        if (!counted[row.frame]) ++shared[row.frame];
        counted[row.frame] = true;
      }
    }
    for (int f = 0; f < frames_; ++f) {
      if (shared[f] >= options_.min_places) continue;
      throw InputError(sequence.folder.string() + ": frame " + std::to_string(sequence.frames[f].number) +
                       " shares " + std::to_string(shared[f]) +
                       " places with other frames, which is fewer than " +
                       std::to_string(options_.min_places) +
                       "; its gain can't be told: add frames between, or leave it out");
    }
  }

  double Predict(const Row& row, int channel, Slope* slope) const {
    const double gain = std::exp(fit_.wall.log_gain[row.frame]);
    const double direct = gain * row.light * std::exp(fit_.spread_off * row.by_spread);
    const double total = direct + fit_.wall.strength[channel] * row.bounced;
    const double share = fit_.contrast * direct / total;
    slope->by_gain = share;
    slope->by_extra.fill(0);
    if (free_[channel]) slope->by_extra[channel] = fit_.contrast * row.bounced / total;
    if (free_[kSpread]) slope->by_extra[kSpread] = share * row.by_spread;
    if (free_[kContrast]) slope->by_extra[kContrast] = std::log(total);
    return fit_.contrast * std::log(total);
  }

  double Weight(double residual) const {
    const double u = residual / (kTukey * scale_);
    return std::abs(u) < 1 ? (1 - u * u) * (1 - u * u) : 0;
  }

  // Of the robust mean over the rows; `weights`: of the last round's.
  double MeanResidual(const Group& group) const {
    Slope slope;
    std::vector<double> residuals;
    for (const Row& row : group.rows) residuals.push_back(row.value - Predict(row, group.channel, &slope));
    return RobustMean(residuals);
  }

  double RobustMean(const std::vector<double>& residuals) const {
    double mean = MedianOf(residuals);
    for (int i = 0; i < 4; ++i) {
      double sum = 0, weights = 0;
      for (double r : residuals) {
        const double w = Weight(r - mean);
        sum += w * r;
        weights += w;
      }
      if (weights > 0) mean = sum / weights;
    }
    return mean;
  }

  // The normal equations with the albedos eliminated, and each cell's part of the gradient.
  void Accumulate() {
    normal_ = MatrixXd::Zero(columns(), columns());
    scores_ = MatrixXd::Zero(columns(), cells_);
    std::vector<double> magnitudes;
    std::vector<Slope> slopes;
    std::vector<double> residuals, weights;
    for (const Group& group : groups_) {
      slopes.resize(group.rows.size());
      residuals.clear();
      for (size_t i = 0; i < group.rows.size(); ++i)
        residuals.push_back(group.rows[i].value - Predict(group.rows[i], group.channel, &slopes[i]));
      const double mean = RobustMean(residuals);
      VectorXd mean_row = VectorXd::Zero(columns());
      double weight_sum = 0;
      weights.clear();
      for (size_t i = 0; i < residuals.size(); ++i) {
        residuals[i] -= mean;
        magnitudes.push_back(std::abs(residuals[i]));
        const double w = Weight(residuals[i]);
        weights.push_back(w);
        weight_sum += w;
        AddRow(group.rows[i].frame, slopes[i], w, &mean_row);
      }
      if (!(weight_sum > 0)) continue;
      for (size_t i = 0; i < residuals.size(); ++i) {
        AddSquare(group.rows[i].frame, slopes[i], weights[i]);
        auto score = scores_.col(group.cell);
        AddRow(group.rows[i].frame, slopes[i], weights[i] * residuals[i], &score);
      }
      TakeOutAlbedo(group, mean_row, weight_sum);
    }
    // Centred on their own means, residuals are too small by the share of the albedos in the unknowns.
    const double share = 1 - double(groups_.size()) / double(std::max<size_t>(1, magnitudes.size()));
    scale_ = std::max(kOfNormal * MedianOf(std::move(magnitudes)) / std::sqrt(std::max(share, 0.1)), 1e-4);
    fit_.residual = scale_;
  }

  template <class Vector>
  void AddRow(int frame, const Slope& slope, double factor, Vector* sum) const {
    (*sum)[frame] += factor * slope.by_gain;
    for (int i = 0; i < kExtras; ++i) (*sum)[frames_ + i] += factor * slope.by_extra[i];
  }

  void AddSquare(int frame, const Slope& slope, double weight) {
    normal_(frame, frame) += weight * slope.by_gain * slope.by_gain;
    for (int i = 0; i < kExtras; ++i) {
      const double cross = weight * slope.by_gain * slope.by_extra[i];
      normal_(frame, frames_ + i) += cross;
      normal_(frames_ + i, frame) += cross;
      for (int k = 0; k < kExtras; ++k)
        normal_(frames_ + i, frames_ + k) += weight * slope.by_extra[i] * slope.by_extra[k];
    }
  }

  // A group names few of the frames: only these columns' products differ from 0.
  void TakeOutAlbedo(const Group& group, const VectorXd& sum, double weight_sum) {
    std::vector<int> columns;
    for (const Row& row : group.rows) columns.push_back(row.frame);
    for (int i = 0; i < kExtras; ++i) columns.push_back(frames_ + i);
    for (int i : columns) {
      for (int k : columns) normal_(i, k) -= sum[i] * sum[k] / weight_sum;
    }
  }

  // Frame 0's gain and what isn't estimated stay.
  std::vector<int> FreeColumns() const {
    std::vector<int> columns;
    for (int f = 1; f < frames_; ++f) columns.push_back(f);
    for (int i = 0; i < kExtras; ++i) {
      if (free_[i] && !(i < 3 && at_zero_[i])) columns.push_back(frames_ + i);
    }
    return columns;
  }

  void Step() {
    const VectorXd gradient = scores_.rowwise().sum();
    VectorXd step = VectorXd::Zero(this->columns());
    at_zero_.fill(false);
    // Bounced light is never negative: what would make it so is held at 0 and the rest solved again.
    for (bool again = true; again;) {
      const std::vector<int> columns = FreeColumns();
      step.setZero();
      step(columns) = normal_(columns, columns).ldlt().solve(gradient(columns).eval()).eval();
      again = false;
      for (int c = 0; c < 3; ++c) {
        if (at_zero_[c] || !free_[c] || fit_.wall.strength[c] + step[frames_ + c] > 0) continue;
        at_zero_[c] = again = true;
      }
    }
    fit_.wall.log_gain += step.head(frames_).cwiseMax(-1).cwiseMin(1);
    for (int c = 0; c < 3; ++c) {
      double& strength = fit_.wall.strength[c];
      strength = at_zero_[c] ? 0 : strength + step[frames_ + c];
    }
    fit_.spread_off += std::clamp(step[frames_ + kSpread], -1.0, 1.0);
    fit_.contrast += std::clamp(step[frames_ + kContrast], -0.3, 0.3);
  }

  void Errors() {
    const std::vector<int> columns = FreeColumns();
    const MatrixXd inverse =
        normal_(columns, columns).ldlt().solve(MatrixXd::Identity(columns.size(), columns.size()));
    const MatrixXd scores = scores_(columns, Eigen::all);
    const MatrixXd covariance = inverse * (scores * scores.transpose()) * inverse;
    fit_.log_gain_error = VectorXd::Zero(frames_);
    for (size_t i = 0; i < columns.size(); ++i) {
      const double error = std::sqrt(covariance(i, i));
      if (columns[i] < frames_) fit_.log_gain_error[columns[i]] = error;
      if (columns[i] == frames_ + kSpread) fit_.spread_error = error;
      if (columns[i] == frames_ + kContrast) fit_.contrast_error = error;
    }
  }

  const GainFitOptions& options_;
  int frames_, cells_ = 0;
  std::vector<Group> groups_;
  std::array<bool, kExtras> free_{};
  std::array<bool, 3> at_zero_{};  // strengths that would be negative
  double scale_ = 1;
  MatrixXd normal_, scores_;
  GainFit fit_;
};

}  // namespace

GainFit FitGains(const Sequence& sequence, const Sightings& sightings,
                 const std::vector<Eigen::ArrayXXf>& bounced, const GainFitOptions& options,
                 const GainFit* start) {
  Problem problem(sequence, sightings, bounced, options);
  problem.Solve(start);
  problem.Responses(sightings.count());
  return problem.fit();
}

}  // namespace lumen
