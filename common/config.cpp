#include "common/config.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/config_document.h"
#include "common/files.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

std::string Shortest(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

std::string Described(Range range) {
  constexpr double kMost = std::numeric_limits<double>::max();
  const bool bounded = range.high < kMost;
  if (range.low == std::numeric_limits<double>::min()) {
    return bounded ? "above 0 and at most " + Shortest(range.high) : "above 0";
  }
  if (range.low <= -kMost) return bounded ? "at most " + Shortest(range.high) : "a finite number";
  return bounded ? "between " + Shortest(range.low) + " and " + Shortest(range.high)
                 : "at least " + Shortest(range.low);
}

std::string Listed(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

}  // namespace

struct ConfigTable::Node {
  std::shared_ptr<ConfigDocument> document;
  const toml::table* table;
  std::string path;  // empty for the root

  const toml::node* Find(std::string_view key) const { return document->Find(*table, key); }

  // `what` says what should be there: "a number".
  const toml::node& Require(std::string_view key, const std::string& what) const {
    if (const toml::node* node = Find(key)) return *node;
    const std::string nearest = document->Misspelling(*table, key);
    const std::string remedy = nearest.empty() ? "" : " (is \"" + nearest + "\" a slip of the pen?)";
    Fail(key, *table, "missing; " + what + " is needed" + remedy);
  }

  [[noreturn]] void Fail(std::string_view key, const toml::node& node, const std::string& problem) const {
    document->Fail(Joined(path, key), node, problem);
  }

  double ToNumber(std::string_view key, const toml::node& node, Range range) const {
    double value = 0;
    if (const auto* integer = node.as_integer()) {
      value = static_cast<double>(integer->get());
    } else if (const auto* real = node.as_floating_point()) {
      value = real->get();
    } else {
      Fail(key, node, "is " + KindOf(node) + ", but must be a number");
    }
    CheckRange(key, node, value, range);
    return value;
  }

  void CheckRange(std::string_view key, const toml::node& node, double value, Range range) const {
    if (std::isfinite(value) && value >= range.low && value <= range.high) return;
    Fail(key, node, "is " + Shortest(value) + ", but must be " + Described(range));
  }

  std::string ToString(std::string_view key, const toml::node& node) const {
    if (const auto* text = node.as_string()) return text->get();
    Fail(key, node, "is " + KindOf(node) + ", but must be a string in quotes");
  }

  const toml::array& ToArray(std::string_view key, const toml::node& node, const std::string& what) const {
    if (const auto* array = node.as_array()) return *array;
    Fail(key, node, "is " + KindOf(node) + ", but must be " + what);
  }

  ConfigTable ToTable(std::string_view key, const toml::node& node) const {
    const toml::table* sub_table = node.as_table();
    if (!sub_table) Fail(key, node, "is " + KindOf(node) + ", but must be a table");
    return ConfigTable(std::make_shared<Node>(Node{document, sub_table, Joined(path, key)}));
  }
};

ConfigTable::ConfigTable(std::shared_ptr<const Node> node) : node_(std::move(node)) {}

bool ConfigTable::Has(std::string_view key) const { return node_->Find(key) != nullptr; }

double ConfigTable::Number(std::string_view key, Range range) const {
  return node_->ToNumber(key, node_->Require(key, "a number"), range);
}

double ConfigTable::Number(std::string_view key, double otherwise, Range range) const {
  return Has(key) ? Number(key, range) : otherwise;
}

int64_t ConfigTable::Integer(std::string_view key, Range range) const {
  const toml::node& node = node_->Require(key, "an integer");
  const auto* integer = node.as_integer();
  if (!integer)
    node_->Fail(key, node, "is " + KindOf(node) + ", but must be an integer (no point, no exponent)");
  node_->CheckRange(key, node, static_cast<double>(integer->get()), range);
  return integer->get();
}

int64_t ConfigTable::Integer(std::string_view key, int64_t otherwise, Range range) const {
  return Has(key) ? Integer(key, range) : otherwise;
}

bool ConfigTable::Flag(std::string_view key, bool otherwise) const {
  const toml::node* node = node_->Find(key);
  if (!node) return otherwise;
  const auto* flag = node->as_boolean();
  if (!flag) node_->Fail(key, *node, "is " + KindOf(*node) + ", but must be true or false");
  return flag->get();
}

std::string ConfigTable::String(std::string_view key) const {
  return node_->ToString(key, node_->Require(key, "a string"));
}

std::string ConfigTable::String(std::string_view key, const std::string& otherwise) const {
  return Has(key) ? String(key) : otherwise;
}

std::string ConfigTable::Choice(std::string_view key, const std::vector<std::string>& choices) const {
  const toml::node& node = node_->Require(key, "one of: " + Listed(choices));
  const std::string word = node_->ToString(key, node);
  if (std::find(choices.begin(), choices.end(), word) == choices.end()) {
    node_->Fail(key, node, "is \"" + word + "\", but must be one of: " + Listed(choices));
  }
  return word;
}

std::string ConfigTable::Choice(std::string_view key, const std::string& otherwise,
                                const std::vector<std::string>& choices) const {
  return Has(key) ? Choice(key, choices) : otherwise;
}

fs::path ConfigTable::Path(std::string_view key) const {
  const toml::node& node = node_->Require(key, "a path");
  const fs::path path = node_->ToString(key, node);
  if (path.empty()) node_->Fail(key, node, "is empty, but must be a path");
  return node_->document->Resolved(Joined(node_->path, key), node, path);
}

std::vector<double> ConfigTable::Numbers(std::string_view key, size_t size, Range range) const {
  const std::string what = size ? "an array of " + std::to_string(size) + " numbers" : "an array of numbers";
  const toml::node& node = node_->Require(key, what);
  const toml::array& array = node_->ToArray(key, node, what);
  if (size && array.size() != size) {
    node_->Fail(key, node, "has " + std::to_string(array.size()) + " elements, but must be " + what);
  }
  std::vector<double> numbers;
  for (size_t i = 0; i < array.size(); ++i) {
    numbers.push_back(node_->ToNumber(Joined(std::string(key), std::to_string(i)), *array.get(i), range));
  }
  return numbers;
}

std::vector<std::string> ConfigTable::Strings(std::string_view key) const {
  const std::string what = "an array of strings";
  const toml::array& array = node_->ToArray(key, node_->Require(key, what), what);
  std::vector<std::string> strings;
  for (size_t i = 0; i < array.size(); ++i) {
    strings.push_back(node_->ToString(Joined(std::string(key), std::to_string(i)), *array.get(i)));
  }
  return strings;
}

Vec3d ConfigTable::Vector(std::string_view key, Range range) const {
  return Vec3d(Numbers(key, 3, range).data());
}

Vec3d ConfigTable::Vector(std::string_view key, const Vec3d& otherwise, Range range) const {
  return Has(key) ? Vector(key, range) : otherwise;
}

ConfigTable ConfigTable::Table(std::string_view key) const {
  return node_->ToTable(key, node_->Require(key, "a table"));
}

std::optional<ConfigTable> ConfigTable::Optional(std::string_view key) const {
  const toml::node* node = node_->Find(key);
  if (!node) return std::nullopt;
  return node_->ToTable(key, *node);
}

std::vector<ConfigTable> ConfigTable::Tables(std::string_view key) const {
  std::vector<ConfigTable> tables;
  const toml::node* node = node_->Find(key);
  if (!node) return tables;
  const toml::array& array = node_->ToArray(key, *node, "an array of tables ([[...]])");
  for (size_t i = 0; i < array.size(); ++i) {
    tables.push_back(node_->ToTable(Joined(std::string(key), std::to_string(i)), *array.get(i)));
  }
  return tables;
}

void ConfigTable::Fail(std::string_view key, const std::string& problem) const {
  // The key may name an element ("source.0"); its array's line is near enough.
  const toml::node* node = node_->table->get(key.substr(0, key.find('.')));
  node_->Fail(key, node ? *node : *node_->table, problem);
}

Config Config::Read(const fs::path& file, const std::vector<std::string>& settings) {
  return Parse(ReadFile(file), file.string(), file.parent_path(), settings);
}

Config Config::ReadWithBase(const fs::path& file, const std::vector<std::string>& settings) {
  return Config(
      std::make_shared<ConfigDocument>(ReadFile(file), file.string(), file.parent_path(), settings, true));
}

Config Config::Parse(std::string_view text, const std::string& name, const fs::path& folder,
                     const std::vector<std::string>& settings) {
  return Config(std::make_shared<ConfigDocument>(text, name, folder, settings));
}

Config::Config(std::shared_ptr<ConfigDocument> document)
    : root_(std::make_shared<const ConfigTable::Node>(ConfigTable::Node{document, &document->root(), ""})) {}

ConfigTable Config::root() const { return ConfigTable(root_); }

void Config::RejectUnknown() const { root_->document->RejectUnknown(); }

}  // namespace lumen
