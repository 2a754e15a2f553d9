#include "common/config.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>
#include <set>

#include "common/error.h"
#include "common/files.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// One file with its settings, shared by every table that is read from it.
struct Document {
  std::string name;
  fs::path folder;
  toml::table root;
  std::map<std::string, std::string> settings;  // what the command line has set: path of the key → setting

  std::mutex mutex;
  std::map<const toml::table*, std::set<std::string, std::less<>>> asked;
};

// What is under a key, and the key's own place: arrays of tables and plain arrays alike.
std::string Joined(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

// The setting that a value comes from: that of the longest part of its path. Null where it comes from the
// file.
const std::string* SettingOf(const Document& document, const std::string& path) {
  for (std::string part = path; !part.empty();) {
    if (const auto set = document.settings.find(part); set != document.settings.end()) return &set->second;
    const size_t dot = part.rfind('.');
    part.resize(dot == std::string::npos ? 0 : dot);
  }
  return nullptr;
}

// "FILE:LINE: path.to.key: problem", or "--set path.to.key=value: path.to.key: problem".
[[noreturn]] void FailAt(const Document& document, const std::string& path, uint32_t line,
                         const std::string& problem) {
  const std::string* setting = SettingOf(document, path);
  const std::string place =
      setting ? "--set " + *setting : document.name + ":" + std::to_string(std::max(line, 1u));
  throw InputError(place + ": " + (path.empty() ? "" : path + ": ") + problem);
}

// Levenshtein's distance.
size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = std::exchange(row[0], i + 1);
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({changed, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

// The candidate that was most likely meant; empty where none resembles the key. Words of one or two letters
// are all alike.
template <class Candidates>
std::string Nearest(std::string_view key, const Candidates& candidates) {
  std::string nearest;
  if (key.size() < 3) return nearest;
  size_t least = std::max(std::min<size_t>(2, key.size() / 2), key.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const size_t distance = EditDistance(key, candidate);
    if (distance < least) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

template <class Words>
std::string Listed(const Words& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

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

std::string Kind(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number with a fraction";
    case toml::node_type::boolean:
      return "true or false";
    default:
      return "a date or a time";
  }
}

// The value of a setting: TOML, or a bare word.
void Assign(toml::table* table, const std::string& key, const std::string& text, const std::string& setting) {
  try {
    toml::table parsed = toml::parse("value = " + text);
    if (parsed.size() == 1) {
      table->insert_or_assign(key, std::move(*parsed.get("value")));
      return;
    }
  } catch (const toml::parse_error& error) {
    // What starts as TOML's own notation was meant as such.
    if (!text.empty() && std::string_view("\"'[{").find(text[0]) != std::string_view::npos) {
      throw InputError("--set " + setting +
                       ": not a value in TOML's notation: " + std::string(error.description()));
    }
  }
  table->insert_or_assign(key, text);
}

// Position in an array that a part of a setting's path names.
size_t ElementOf(const toml::array& array, const std::string& part, const std::string& path,
                 const std::string& setting) {
  size_t index = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (error != std::errc() || end != part.data() + part.size() || index >= array.size()) {
    throw InputError("--set " + setting + ": " + path + " is an array of " + std::to_string(array.size()) +
                     ", counted from 0; \"" + part + "\" is none of its elements");
  }
  return index;
}

// Puts one setting into the tree; tables on its way that don't exist are made.
void Set(Document* document, const std::string& setting) {
  const size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw InputError("--set " + setting + ": write it as path.to.key=value");
  }
  const std::string full_path = setting.substr(0, equals);
  std::vector<std::string> parts(1);
  for (char c : full_path) c == '.' ? parts.emplace_back() : (parts.back() += c, parts.back());
  toml::node* node = &document->root;
  std::string path;
  for (size_t i = 0; i < parts.size(); ++i) {
    const std::string& part = parts[i];
    if (part.empty()) throw InputError("--set " + setting + ": a part of the path is empty");
    const bool last = i + 1 == parts.size();
    const std::string outer = path;
    path = Joined(path, part);
    if (toml::table* table = node->as_table()) {
      if (last) {
        Assign(table, part, setting.substr(equals + 1), setting);
        break;
      }
      if (!table->contains(part)) {
        table->insert(part, toml::table{});
        document->settings[path] = setting;
      }
      node = table->get(part);
    } else if (toml::array* array = node->as_array()) {
      const size_t index = ElementOf(*array, part, outer, setting);
      if (last) {
        toml::table value;
        Assign(&value, part, setting.substr(equals + 1), setting);
        array->replace(array->cbegin() + static_cast<ptrdiff_t>(index), std::move(*value.get(part)));
        break;
      }
      node = array->get(index);
    } else {
      throw InputError("--set " + setting + ": " + outer + " is " + Kind(*node) + " and has no \"" + part +
                       "\"");
    }
  }
  // What earlier settings have put below this key is gone.
  std::erase_if(document->settings, [&](const auto& set) { return set.first.starts_with(path + "."); });
  document->settings[path] = setting;
}

}  // namespace

struct ConfigTable::Node {
  std::shared_ptr<Document> document;
  const toml::table* table;
  std::string path;  // empty for the root

  const toml::node* Find(std::string_view key) const {
    const std::lock_guard lock(document->mutex);
    document->asked[table].emplace(key);
    return table->get(key);
  }

  // `what` says what should be there: "a number".
  const toml::node& Require(std::string_view key, const std::string& what) const {
    if (const toml::node* node = Find(key)) return *node;
    // A key that somebody knows is no misspelling of this one.
    std::vector<std::string> strangers;
    const auto& known = document->asked[table];
    for (const auto& [name, unused] : *table) {
      if (!known.contains(name.str())) strangers.emplace_back(name.str());
    }
    const std::string nearest = Nearest(key, strangers);
    const std::string remedy = nearest.empty() ? "" : " (is \"" + nearest + "\" a slip of the pen?)";
    FailAt(*document, Joined(path, key), table->source().begin.line,
           "missing; " + what + " is needed" + remedy);
  }

  [[noreturn]] void Fail(std::string_view key, const toml::node& node, const std::string& problem) const {
    FailAt(*document, Joined(path, key), node.source().begin.line, problem);
  }

  double ToNumber(std::string_view key, const toml::node& node, Range range) const {
    double value = 0;
    if (const auto* integer = node.as_integer()) {
      value = static_cast<double>(integer->get());
    } else if (const auto* real = node.as_floating_point()) {
      value = real->get();
    } else {
      Fail(key, node, "is " + Kind(node) + ", but must be a number");
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
    Fail(key, node, "is " + Kind(node) + ", but must be a string in quotes");
  }

  const toml::array& ToArray(std::string_view key, const toml::node& node, const std::string& what) const {
    if (const auto* array = node.as_array()) return *array;
    Fail(key, node, "is " + Kind(node) + ", but must be " + what);
  }

  ConfigTable ToTable(std::string_view key, const toml::node& node) const {
    const toml::table* sub_table = node.as_table();
    if (!sub_table) Fail(key, node, "is " + Kind(node) + ", but must be a table");
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
    node_->Fail(key, node, "is " + Kind(node) + ", but must be an integer (no point, no exponent)");
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
  if (!flag) node_->Fail(key, *node, "is " + Kind(*node) + ", but must be true or false");
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
  const bool from_file = !SettingOf(*node_->document, Joined(node_->path, key));
  return from_file ? node_->document->folder / path : path;
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

namespace {

struct UnknownKey {
  std::string path;
  uint32_t line;
  std::string problem;
};

void FindUnknown(const Document& document, const toml::node& node, const std::string& path,
                 std::vector<UnknownKey>* unknown) {
  if (const toml::array* array = node.as_array()) {
    for (size_t i = 0; i < array->size(); ++i) {
      // Only tables that were read as such have keys to know.
      const toml::table* element = array->get(i)->as_table();
      if (element && document.asked.contains(element)) {
        FindUnknown(document, *element, Joined(path, std::to_string(i)), unknown);
      }
    }
    return;
  }
  const toml::table* table = node.as_table();
  if (!table) return;
  const auto asked = document.asked.find(table);
  const std::set<std::string, std::less<>> none;
  const auto& known = asked == document.asked.end() ? none : asked->second;
  for (const auto& [key, value] : *table) {
    if (known.contains(key.str())) {
      FindUnknown(document, value, Joined(path, key.str()), unknown);
      continue;
    }
    const std::string nearest = Nearest(key.str(), known);
    std::string problem = "unknown key";
    if (!nearest.empty()) {
      problem += "; is \"" + nearest + "\" meant?";
    } else if (!known.empty()) {
      problem += "; known here: " + Listed(known);
    }
    unknown->push_back({Joined(path, key.str()), value.source().begin.line, problem});
  }
}

}  // namespace

Config Config::Read(const fs::path& file, const std::vector<std::string>& settings) {
  return Parse(ReadFile(file), file.string(), file.parent_path(), settings);
}

Config Config::Parse(std::string_view text, const std::string& name, const fs::path& folder,
                     const std::vector<std::string>& settings) {
  const auto document = std::make_shared<Document>();
  document->name = name;
  document->folder = folder;
  try {
    document->root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw InputError(name + ":" + std::to_string(error.source().begin.line) +
                     ": not TOML: " + std::string(error.description()));
  }
  for (const std::string& setting : settings) Set(document.get(), setting);
  Config config;
  config.root_ = std::make_shared<const ConfigTable::Node>(ConfigTable::Node{document, &document->root, ""});
  return config;
}

ConfigTable Config::root() const { return ConfigTable(root_); }

void Config::RejectUnknown() const {
  Document& document = *root_->document;
  const std::lock_guard lock(document.mutex);
  std::vector<UnknownKey> unknown;
  FindUnknown(document, document.root, "", &unknown);
  if (unknown.empty()) return;
  const auto first = std::min_element(unknown.begin(), unknown.end(),
                                      [](const auto& a, const auto& b) { return a.line < b.line; });
  FailAt(document, first->path, first->line, first->problem);
}

}  // namespace lumen
