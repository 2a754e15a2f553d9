#include "common/config_document.h"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <utility>

#include "common/error.h"
#include "common/files.h"

namespace lumen {
namespace {

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

std::string Listed(const std::set<std::string, std::less<>>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
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

// Throws InputError naming the line. Nodes remember the name.
toml::table ParsedText(std::string_view text, const std::string& name) {
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    throw InputError(name + ":" + std::to_string(error.source().begin.line) +
                     ": not TOML: " + std::string(error.description()));
  }
}

// Puts everything of one table into another: tables into tables, anything else in place of what is there.
void Overlay(toml::table&& over, toml::table* under) {
  for (auto&& [key, value] : over) {
    toml::table* own = value.as_table();
    toml::node* other = under->get(key.str());
    if (own && other && other->is_table()) {
      Overlay(std::move(*own), other->as_table());
    } else {
      under->insert_or_assign(key, std::move(value));
    }
  }
}

// "a.b.c" → a, b, c.
std::vector<std::string> Parts(const std::string& path) {
  std::vector<std::string> parts;
  size_t begin = 0;
  for (size_t dot = path.find('.'); dot != std::string::npos; dot = path.find('.', begin)) {
    parts.push_back(path.substr(begin, dot - begin));
    begin = dot + 1;
  }
  parts.push_back(path.substr(begin));
  return parts;
}

}  // namespace

std::string Joined(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

std::string KindOf(const toml::node& node) {
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

ConfigDocument::ConfigDocument(std::string_view text, const std::string& name,
                               const std::filesystem::path& folder, const std::vector<std::string>& settings,
                               bool may_have_base)
    : name_(name), folder_(folder), root_(ParsedText(text, name)) {
  if (may_have_base && root_.contains("base")) PutOnBase();
  for (const std::string& setting : settings) Set(setting);
}

void ConfigDocument::PutOnBase() {
  const toml::node& key = *root_.get("base");
  const auto* path = key.as_string();
  if (!path) Fail("base", key, "is " + KindOf(key) + ", but must be a path in quotes");
  const std::filesystem::path file = folder_ / path->get();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    Fail("base", key, "there is no file " + file.string());
  }
  base_name_ = file.string();
  base_folder_ = file.parent_path();
  toml::table base = ParsedText(ReadFile(file), base_name_);
  if (base.contains("base")) Fail("base", *base.get("base"), "a base has no base of its own; leave it out");
  root_.erase("base");
  Overlay(std::move(root_), &base);
  root_ = std::move(base);
}

// The file whose text the node stands in.
const std::string& ConfigDocument::SourceOf(const toml::node& node) const {
  const auto& path = node.source().path;
  return path && !base_name_.empty() && *path == base_name_ ? base_name_ : name_;
}

// Tables on the setting's way that don't exist are made.
void ConfigDocument::Set(const std::string& setting) {
  const size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw InputError("--set " + setting + ": write it as path.to.key=value");
  }
  const std::vector<std::string> parts = Parts(setting.substr(0, equals));
  const std::string text = setting.substr(equals + 1);
  toml::node* node = &root_;
  std::string path;
  for (size_t i = 0; i < parts.size(); ++i) {
    const std::string& part = parts[i];
    if (part.empty()) throw InputError("--set " + setting + ": a part of the path is empty");
    const bool last = i + 1 == parts.size();
    const std::string outer = path;
    path = Joined(path, part);
    if (toml::table* table = node->as_table()) {
      if (last) {
        Assign(table, part, text, setting);
        break;
      }
      if (!table->contains(part)) {
        table->insert(part, toml::table{});
        settings_[path] = setting;
      }
      node = table->get(part);
    } else if (toml::array* array = node->as_array()) {
      const size_t index = ElementOf(*array, part, outer, setting);
      if (last) {
        toml::table value;
        Assign(&value, part, text, setting);
        array->replace(array->cbegin() + static_cast<ptrdiff_t>(index), std::move(*value.get(part)));
        break;
      }
      node = array->get(index);
    } else {
      throw InputError("--set " + setting + ": " + outer + " is " + KindOf(*node) + " and has no \"" + part +
                       "\"");
    }
  }
  // What earlier settings have put below this key is gone.
  std::erase_if(settings_, [&](const auto& set) { return set.first.starts_with(path + "."); });
  settings_[path] = setting;
}

// That of the longest part of the path; null where the value comes from the file.
const std::string* ConfigDocument::SettingOf(const std::string& path) const {
  for (std::string part = path; !part.empty();) {
    if (const auto set = settings_.find(part); set != settings_.end()) return &set->second;
    const size_t dot = part.rfind('.');
    part.resize(dot == std::string::npos ? 0 : dot);
  }
  return nullptr;
}

void ConfigDocument::Fail(const std::string& path, const toml::node& node, const std::string& problem) const {
  const std::string* setting = SettingOf(path);
  // Nodes that the command line has made have no line; a file's root begins with its first.
  const std::string line = std::to_string(std::max(node.source().begin.line, 1u));
  const std::string place = setting ? "--set " + *setting : SourceOf(node) + ":" + line;
  throw InputError(place + ": " + (path.empty() ? "" : path + ": ") + problem);
}

std::filesystem::path ConfigDocument::Resolved(const std::string& path, const toml::node& node,
                                               const std::filesystem::path& file) const {
  if (SettingOf(path)) return file;
  return (&SourceOf(node) == &base_name_ ? base_folder_ : folder_) / file;
}

const toml::node* ConfigDocument::Find(const toml::table& table, std::string_view key) {
  const std::lock_guard lock(mutex_);
  asked_[&table].emplace(key);
  return table.get(key);
}

std::string ConfigDocument::Misspelling(const toml::table& table, std::string_view key) {
  const std::lock_guard lock(mutex_);
  // A key that somebody knows is no misspelling of this one.
  std::vector<std::string> strangers;
  for (const auto& [name, unused] : table) {
    if (!asked_[&table].contains(name.str())) strangers.emplace_back(name.str());
  }
  return Nearest(key, strangers);
}

void ConfigDocument::FindUnknown(const toml::node& node, const std::string& path,
                                 std::vector<UnknownKey>* unknown) const {
  if (const toml::array* array = node.as_array()) {
    for (size_t i = 0; i < array->size(); ++i) {
      if (array->get(i)->is_table()) FindUnknown(*array->get(i), Joined(path, std::to_string(i)), unknown);
    }
    return;
  }
  const toml::table* table = node.as_table();
  if (!table) return;
  const auto asked = asked_.find(table);
  const Keys known = asked == asked_.end() ? Keys() : asked->second;
  for (const auto& [key, value] : *table) {
    if (known.contains(key.str())) {
      FindUnknown(value, Joined(path, key.str()), unknown);
      continue;
    }
    const std::string nearest = Nearest(key.str(), known);
    std::string problem = "unknown key";
    if (!nearest.empty()) {
      problem += "; is \"" + nearest + "\" meant?";
    } else if (!known.empty()) {
      problem += "; known here: " + Listed(known);
    }
    unknown->push_back({Joined(path, key.str()), &value, problem});
  }
}

void ConfigDocument::RejectUnknown() {
  const std::lock_guard lock(mutex_);
  std::vector<UnknownKey> unknown;
  FindUnknown(root_, "", &unknown);
  if (unknown.empty()) return;
  const auto first = std::ranges::min_element(
      unknown, {}, [](const UnknownKey& key) { return key.node->source().begin.line; });
  Fail(first->path, *first->node, first->problem);
}

}  // namespace lumen
