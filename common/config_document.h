// A parsed configuration file with the command line's settings on top, and what has been asked of it: what
// stands behind Config and ConfigTable.
#pragma once

#include <toml++/toml.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace lumen {

class ConfigDocument {
 public:
  // Throws InputError where the text isn't TOML or a setting can't be put into it. may_have_base: the text's
  // key `base` names a file, from its folder, that holds what the text doesn't.
  ConfigDocument(std::string_view text, const std::string& name, const std::filesystem::path& folder,
                 const std::vector<std::string>& settings, bool may_have_base = false);

  const toml::table& root() const { return root_; }

  // What a table has under a key, which is known from now on; null = nothing.
  const toml::node* Find(const toml::table& table, std::string_view key);
  // The key of a table that may be a misspelling of `key`; empty = none.
  std::string Misspelling(const toml::table& table, std::string_view key);
  // Throws InputError for the first key that nobody has asked for.
  void RejectUnknown();

  // The node under the path is a file name in a text: it counts from that text's folder. From the command
  // line it stands as it is.
  std::filesystem::path Resolved(const std::string& path, const toml::node& node,
                                 const std::filesystem::path& file) const;

  // Throws InputError "FILE:LINE: path.to.key: problem", or "--set path.to.key=value: path.to.key: problem".
  [[noreturn]] void Fail(const std::string& path, const toml::node& node, const std::string& problem) const;

 private:
  using Keys = std::set<std::string, std::less<>>;
  struct UnknownKey {
    std::string path;
    const toml::node* node;
    std::string problem;
  };

  void PutOnBase();
  void Set(const std::string& setting);
  const std::string& SourceOf(const toml::node& node) const;
  const std::string* SettingOf(const std::string& path) const;
  void FindUnknown(const toml::node& node, const std::string& path, std::vector<UnknownKey>* unknown) const;

  std::string name_;
  std::filesystem::path folder_;
  std::string base_name_;  // empty = there is none
  std::filesystem::path base_folder_;
  toml::table root_;
  std::map<std::string, std::string> settings_;  // path of a key → the setting that it comes from
  std::mutex mutex_;
  std::map<const toml::table*, Keys> asked_;
};

// "path.key"; an element's key is its index.
std::string Joined(const std::string& path, std::string_view key);

// "a table", "an integer", …
std::string KindOf(const toml::node& node);

}  // namespace lumen
