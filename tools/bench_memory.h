// Resident memory, as benchmarks measure it.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace lumen {

inline constexpr int kBytesPerMegabyte = 1 << 20;

// The most memory that the process holds while body runs, less what it held before, MB: resident pages, as
// the kernel counts them (VmHWM, VmRSS). What was allocated and freed before is given back first, so that
// body can't live in pages that are counted already; what stays is less than a page for each piece that is
// free. Throws std::runtime_error where the kernel doesn't tell.
double MegabytesBeyondBefore(const std::function<void()>& body);

// Runs this program with other arguments and answers the number that it prints: threads, caches and code that
// earlier measurements have left behind in this process are not there in that one. Throws std::runtime_error
// where it fails.
double MegabytesOfOtherProcess(const std::vector<std::string>& arguments);

}  // namespace lumen
