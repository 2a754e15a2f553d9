#include "recon/calibration/calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/calibration.h"

namespace lumen {
namespace {

// Half-width of the 95% interval of a gain, in parts of it.
double RelativeReach(const Estimate& log_gain) { return std::expm1(log_gain.Reach()); }

std::string LightLine(const char* name, const Estimate& found, double own, bool tells, bool written) {
  return fmt::format("{:<10} {:.3f} ± {:.3f} (95%), the sequence's own is {:.3f}: {}\n", name, found.value,
                     found.Reach(), own,
                     !tells     ? "the data can't tell it, so the sequence's own stays"
                     : !written ? "the sequence's own stays"
                                : "written");
}

double MeanSpread(const Light& light) {
  double sum = 0;
  for (const LightSource& source : light.sources) sum += source.spread;
  return sum / static_cast<double>(light.sources.size());
}

std::string PercentText(double part) { return fmt::format("{:.2f}%", 100 * part); }

}  // namespace

Findings FindingsOf(const Sequence& sequence, const SequenceCalibration& found, bool everything) {
  const bool knows_gains = std::all_of(sequence.frames.begin(), sequence.frames.end(),
                                       [](const SequenceFrame& frame) { return frame.gain.has_value(); });
  const bool light_in_doubt = everything || !sequence.has_toml;
  return {everything || !knows_gains, light_in_doubt && found.tells_spread,
          light_in_doubt && found.tells_gamma};
}

std::string CalibrationText(const Sequence& sequence, const SequenceCalibration& found,
                            const Findings& findings) {
  std::string text =
      "# Estimated by `lumen calibrate` from what several frames show; read on top of the sequence's own.\n"
      "format = \"lumen-calibration\"\nversion = 1\n\n";
  std::string uncertainty = "[uncertainty]    # standard errors\n";
  if (findings.spread) {
    Light light = sequence.calibration.light;
    const double off = found.spread.value - MeanSpread(light);
    for (LightSource& source : light.sources) source.spread = std::max(0.0, source.spread + off);
    text += LightText(light) + "\n";
    uncertainty += fmt::format("spread = {:.6g}\n", found.spread.standard_error);
  }
  if (findings.gamma) {
    Response response = sequence.calibration.response;
    response.gamma = found.gamma.value;
    text += ResponseText(response) + "\n";
    uncertainty += fmt::format("gamma = {:.6g}\n", found.gamma.standard_error);
  }
  if (findings.gains) {
    std::string numbers, gains, errors;
    for (size_t i = 0; i < found.log_gain.size(); ++i) {
      const char* comma = gains.empty() ? "" : ", ";
      numbers += fmt::format("{}{}", comma, sequence.frames[i].number);
      gains += fmt::format("{}{:.6g}", comma, std::exp(found.log_gain[i].value));
      errors += fmt::format("{}{:.6g}", comma, found.log_gain[i].standard_error);
    }
    text += "[frames]\n";
    if (!sequence.left_out.empty()) text += "number = [" + numbers + "]    # the others' gains are unknown\n";
    text += "gain = [" + gains + "]\n\n";
    uncertainty += "log_gain = [" + errors + "]\n";
  }
  return text + uncertainty;
}

GainComparison CompareGains(const std::vector<double>& log_gain, const std::vector<double>& log_truth) {
  const size_t count = log_gain.size();
  double common = 0;
  for (size_t i = 0; i < count; ++i) common += (log_gain[i] - log_truth[i]) / static_cast<double>(count);
  std::vector<double> off;
  for (size_t i = 0; i < count; ++i) off.push_back(std::abs(std::expm1(log_gain[i] - log_truth[i] - common)));
  std::sort(off.begin(), off.end());
  // The smallest that 95% don't exceed.
  const size_t rank = static_cast<size_t>(std::ceil(0.95 * static_cast<double>(count)));
  return {off[rank - 1], off.back()};
}

std::optional<GainComparisons> CompareWithSequence(const Sequence& sequence,
                                                   const SequenceCalibration& found) {
  std::vector<double> gains, truth, learnt_truth;
  for (size_t i = 0; i < sequence.frames.size(); ++i) {
    if (!sequence.frames[i].gain) return std::nullopt;
    gains.push_back(found.log_gain[i].value);
    truth.push_back(std::log(*sequence.frames[i].gain));
  }
  for (int frame : found.learnt_frames) learnt_truth.push_back(truth[frame]);
  return GainComparisons{CompareGains(gains, truth), CompareGains(found.learnt_log_gain, learnt_truth)};
}

std::string ToTable(const Sequence& sequence, const SequenceCalibration& found, const Findings& findings) {
  std::string table = fmt::format("{} places, {} sightings, residual {:.3f} in log\n", found.fit.places,
                                  found.fit.observations, found.fit.residual);
  table += "frame        gain  95%, ±\n";
  double largest = 0;
  for (size_t i = 0; i < found.log_gain.size(); ++i) {
    const Estimate& gain = found.log_gain[i];
    largest = std::max(largest, RelativeReach(gain));
    table += fmt::format("{:04d}  {:>10.4f}  {:>6}\n", sequence.frames[i].number, std::exp(gain.value),
                         PercentText(RelativeReach(gain)));
  }
  table += fmt::format("gains      of {} frames, relative to frame {:04d}'s, to ± {} (95%) or better: {}\n",
                       found.log_gain.size(), sequence.frames[0].number, PercentText(largest),
                       findings.gains ? "written" : "the sequence's own stay");
  if (const auto compared = CompareWithSequence(sequence, found)) {
    const auto line = [](const char* who, const GainComparison& one) {
      return fmt::format("           {} off the sequence's own: 95th percentile {}, at most {}\n", who,
                         PercentText(one.percentile95), PercentText(one.largest));
    };
    table += line("these are", compared->calibrated) + line("learnt by training alone,", compared->learnt);
  }
  table += LightLine("spread", found.spread, MeanSpread(sequence.calibration.light), found.tells_spread,
                     findings.spread);
  if (!sequence.calibration.response.srgb) {
    table += LightLine("gamma", found.gamma, sequence.calibration.response.gamma, found.tells_gamma,
                       findings.gamma);
  }
  return table;
}

nlohmann::json ToJson(const Sequence& sequence, const SequenceCalibration& found, const Findings& findings) {
  const auto estimate = [](const Estimate& one, bool tells, bool written) {
    return nlohmann::json{
        {"value", one.value}, {"standard_error", one.standard_error}, {"tells", tells}, {"written", written}};
  };
  nlohmann::json frames = nlohmann::json::array();
  for (size_t i = 0; i < found.log_gain.size(); ++i) {
    frames.push_back({{"frame", sequence.frames[i].number},
                      {"gain", std::exp(found.log_gain[i].value)},
                      {"log_gain_standard_error", found.log_gain[i].standard_error}});
  }
  nlohmann::json json = {{"frames", frames},
                         {"gains_written", findings.gains},
                         {"places", found.fit.places},
                         {"sightings", found.fit.observations},
                         {"residual", found.fit.residual},
                         {"bounced_strength", std::vector<double>(found.fit.wall.strength.begin(),
                                                                  found.fit.wall.strength.end())},
                         {"spread", estimate(found.spread, found.tells_spread, findings.spread)},
                         {"gamma", estimate(found.gamma, found.tells_gamma, findings.gamma)}};
  if (const auto compared = CompareWithSequence(sequence, found)) {
    const auto comparison = [](const GainComparison& one) {
      return nlohmann::json{{"percentile95", one.percentile95}, {"largest", one.largest}};
    };
    json["against_sequence"] = {{"calibrated", comparison(compared->calibrated)},
                                {"learnt_by_training", comparison(compared->learnt)}};
  }
  return json;
}

}  // namespace lumen
