#include "tools/study/run_record.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/files.h"

namespace lumen {
namespace {

// JSON has no NaN.
nlohmann::json ToJson(const std::vector<double>& numbers) {
  nlohmann::json json = nlohmann::json::array();
  for (double number : numbers) json.push_back(std::isfinite(number) ? nlohmann::json(number) : nullptr);
  return json;
}

std::vector<double> FromJson(const nlohmann::json& json) {
  std::vector<double> numbers;
  for (const nlohmann::json& number : json) {
    numbers.push_back(number.is_number() ? number.get<double>() : std::numeric_limits<double>::quiet_NaN());
  }
  return numbers;
}

}  // namespace

RunRecord::RunRecord(std::filesystem::path file, std::string subject)
    : file_(std::move(file)), subject_(std::move(subject)) {
  if (!std::filesystem::exists(file_)) return;
  const auto json = nlohmann::json::parse(ReadFile(file_), nullptr, false);
  if (!json.is_object() || !json.contains("subject") || json["subject"] != subject_) return;
  if (!json.contains("runs") || !json["runs"].is_object()) return;
  for (const auto& [key, numbers] : json["runs"].items()) runs_[key] = FromJson(numbers);
}

std::optional<std::vector<double>> RunRecord::Find(const std::string& key) const {
  const auto run = runs_.find(key);
  if (run == runs_.end()) return std::nullopt;
  return run->second;
}

void RunRecord::Add(const std::string& key, const std::vector<double>& numbers) {
  runs_[key] = numbers;
  nlohmann::json runs = nlohmann::json::object();
  for (const auto& [name, values] : runs_) runs[name] = ToJson(values);
  WriteFile(file_, nlohmann::json({{"subject", subject_}, {"runs", runs}}).dump(1) + "\n");
}

}  // namespace lumen
