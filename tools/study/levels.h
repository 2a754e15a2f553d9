// How much of what the paper leaves out a simulated sequence shows.
#pragma once

#include <string>

#include "sim/scene.h"

namespace lumen {

enum class Level {
  kIdeal,  // the paper's assumptions hold
  kFull,   // the scene as it is
};

// "ideal" or "full".
std::string NameOf(Level level);

// Of the scene's effects those that the paper's model has (eq. 3): a colour that varies over the wall and a
// gain a frame.
bool InPapersModel(const std::string& effect);

// kIdeal: one light at the camera, as strong as all the scene's, no light from wall to wall, no coat, none of
// the lens's, the sensor's and the wall's movements' effects. What stays is what the paper's model has:
// texture, and the automatic gain, which is recorded, so that it is known.
void ApplyLevel(Level level, Scene* scene);

}  // namespace lumen
