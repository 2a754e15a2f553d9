// A sequence to train on that is quick to render.
#pragma once

#include "common/sequence.h"
#include "tests/support.h"

namespace lumen::test {

// Six small frames of the default scene, rendered once for all tests.
const Sequence& SmallSequence();

}  // namespace lumen::test
