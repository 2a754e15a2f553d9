// The tables [camera], [light] and [response] of sequence.toml, which scenes share.
#pragma once

#include <string>

#include "common/camera.h"
#include "common/config.h"
#include "common/light.h"
#include "common/response.h"

namespace lumen {

// Each throws InputError with file, line and key where the table describes no such thing. A key `mask` of
// [camera] is the caller's to read.
CameraIntrinsics ReadCamera(const ConfigTable& camera);
// Directions are normalised.
Light ReadLight(const ConfigTable& light);
Response ReadResponse(const ConfigTable& response);

// The same as TOML, every digit, with headings.
std::string CameraText(const CameraIntrinsics& camera);
std::string LightText(const Light& light);
std::string ResponseText(const Response& response);

// "[1, 2.5, 3]", every digit.
std::string ArrayText(const double* values, size_t count);

}  // namespace lumen
