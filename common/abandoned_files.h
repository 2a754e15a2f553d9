// What processes that were killed leave behind.
#pragma once

#include <filesystem>

namespace lumen {

// Removes from a folder the temporary files (see PendingFile) of processes that no longer run on this
// machine. Never fails: what can't be removed stays.
void RemoveAbandonedFiles(const std::filesystem::path& folder);

}  // namespace lumen
