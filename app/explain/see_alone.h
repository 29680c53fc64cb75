// SPDX-License-Identifier: Apache-2.0
//
// Takes   one recording of one camera.
// Gives   its markers and its camera, before it is known what any other recording or camera shows:
//         what can be done apart, on another machine too.
#pragma once

#include <optional>

#include "app/explain/see_cameras.h"

namespace kinescope {

/// The markers (or `cached` ones of an earlier detection, which give the same), and the camera. One
/// that nobody declared is found from the markers' borders; then it is known, and their cells can
/// be used, too. Throws what observe() throws.
[[nodiscard]] SeenAlone see_alone(const Recording& recording, const SightOptions& options,
                                  const std::optional<TagObservations>& cached,
                                  const Progress& progress);

}  // namespace kinescope
