// The two ways in which a run can end early. Everything else that is thrown is a defect of lumen itself.
#pragma once

#include <stdexcept>
#include <string>

namespace lumen {

// The input is at fault. The message is one line: which file, which place in it, what is wrong, what to do.
// The command exits with 1.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace lumen
