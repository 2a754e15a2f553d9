// What has been measured, in a file: a study that was stopped goes on from it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lumen {

// Numbers by key; NaN stands for what could not be measured. The file is whole after every Add.
class RunRecord {
 public:
  // What stands in the file for another subject, or isn't a record, is forgotten.
  RunRecord(std::filesystem::path file, std::string subject);

  std::optional<std::vector<double>> Find(const std::string& key) const;
  void Add(const std::string& key, const std::vector<double>& numbers);

 private:
  std::filesystem::path file_;
  std::string subject_;
  std::map<std::string, std::vector<double>> runs_;
};

}  // namespace lumen
