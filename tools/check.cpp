#include <fmt/core.h>

#include <memory>

#include "common/config.h"
#include "common/error.h"
#include "common/files.h"
#include "tools/findings.h"
#include "tools/options.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

enum class Subject { kSequence, kMesh, kScene };

Subject SubjectOf(const fs::path& path) {
  if (fs::is_directory(path)) return Subject::kSequence;
  if (path.extension() != ".toml") return Subject::kMesh;
  const ConfigTable root = Config::Read(path).root();
  return root.Has("format") && root.String("format") == "lumen-sequence" ? Subject::kSequence
                                                                         : Subject::kScene;
}

// Damaged frames are errors and left out; frames that a download lacks are odd.
Sequence ReadWhatCanBe(const fs::path& folder, Findings* findings) {
  try {
    const Sequence sequence = ReadSequence(folder);
    for (const std::string& line : sequence.left_out) findings->Warn(line);
    return sequence;
  } catch (const DamagedFrame&) {
    const Sequence sequence = ReadSequence(folder, {.skip_damaged = true});
    for (const std::string& line : sequence.left_out) findings->Error(line);
    return sequence;
  }
}

// What can't be read at all is a finding as well.
nlohmann::json Check(const fs::path& path, uint64_t seed, Findings* findings) {
  try {
    switch (SubjectOf(path)) {
      case Subject::kSequence: {
        const fs::path folder = fs::is_directory(path) ? path : path.parent_path();
        return {
            {"sequence", CheckSequence(ReadWhatCanBe(folder.empty() ? "." : folder, findings), findings)}};
      }
      case Subject::kMesh:
        return {{"mesh", CheckMesh(path.string(), ReadMesh(path), findings)}};
      case Subject::kScene:
        return {{"scene", CheckScene(ReadScene(path, {}, seed), findings)}};
    }
  } catch (const InputError& error) {
    findings->Error(error.what());
  }
  return nlohmann::json::object();
}

nlohmann::json Run(const fs::path& path, const CommonOptions& options) {
  Findings findings;
  nlohmann::json result = Check(path, options.seed, &findings);
  result["findings"] = nlohmann::json::array();
  for (const Finding& finding : findings.all()) {
    const char* severity = finding.severity == Finding::Severity::kError ? "error" : "warning";
    fmt::print("{}: {}\n", severity, finding.text);
    result["findings"].push_back({{"severity", severity}, {"text", finding.text}});
  }
  const auto errors = findings.errors();
  result["errors"] = errors.size();
  result["warnings"] = findings.all().size() - errors.size();
  if (errors.empty()) {
    fmt::print("{}: no errors\n", path.string());
    return result;
  }
  // The result is due although the command fails.
  if (!options.json.empty()) WriteFile(options.json, result.dump(2) + "\n");
  if (errors.size() == 1) throw InputError(errors[0]);
  throw InputError(fmt::format("{}: {} errors, the first: {}", path.string(), errors.size(), errors[0]));
}

}  // namespace

void AddCheck(CLI::App* app) {
  const auto path = std::make_shared<fs::path>();
  CLI::App* command = AddSubcommand(app, "check", "says what is wrong with a sequence, a mesh or a scene",
                                    [path](const CommonOptions& options) { return Run(*path, options); });
  command->add_option("path", *path, "a sequence's folder, a mesh or a TOML file")->required();
}

}  // namespace lumen
