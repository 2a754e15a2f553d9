// What `lumen check` finds, and the checks behind it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"

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

}  // namespace lumen
