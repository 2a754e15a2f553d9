// What `lumen check` finds, and the checks behind it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"
#include "sim/scene.h"

namespace lumen {

struct Finding {
  enum class Severity { kError, kWarning };  // wrong, or odd
  Severity severity = Severity::kError;
  std::string text;  // file or frame, what is wrong, what to do
};

class Findings {
 public:
  void Error(const std::string& text) { all_.push_back({Finding::Severity::kError, text}); }
  void Warn(const std::string& text) { all_.push_back({Finding::Severity::kWarning, text}); }
  void Append(const Findings& others) { all_.insert(all_.end(), others.all_.begin(), others.all_.end()); }

  const std::vector<Finding>& all() const { return all_; }
  std::vector<std::string> errors() const;

 private:
  std::vector<Finding> all_;
};

// Closed, manifold, consistently oriented, no degenerate or double face. `name` stands for the mesh in
// messages. The answer holds the counts.
nlohmann::json CheckMesh(const std::string& name, const Mesh& mesh, Findings* findings);

// Light, poses and every file of every frame; depth, normals, flow, poses and the ground truth's mesh against
// each other.
nlohmann::json CheckSequence(const Sequence& sequence, Findings* findings);

// What a scene renders: its wall, its light, its trajectory.
nlohmann::json CheckScene(const Scene& scene, Findings* findings);

// Guides that lie outside any endoscope's tip or shine backwards.
void CheckLight(const Light& light, Findings* findings);

// Steps between frames that are far larger than is usual in the sequence.
void CheckPoses(const std::vector<SequenceFrame>& frames, Findings* findings);

// Upper median; values must not be empty.
double Median(std::vector<double> values);

}  // namespace lumen
