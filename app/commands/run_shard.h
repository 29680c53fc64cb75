// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "app/commands/commands.h"

namespace kinescope {

/// Of `options.shard` the recordings, each read and its markers looked for; leaves a part
/// (shard_parts.h). What an earlier attempt detected in the same folder is not detected again.
/// Throws bad_request where there is one recording only.
[[nodiscard]] ExitCode run_shard(const RunOptions& options, const Console& console);

}  // namespace kinescope
