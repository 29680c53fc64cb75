// SPDX-License-Identifier: Apache-2.0
//
// Takes   a body, and a link whose path is known.
// Gives   whether the body may hang on the link at all, from a few dozen samples: most pairs are no
//         neighbours, and fits of all of them would be most of the work of the search.
// Method  robust linear regression on every channel, and on the principal direction; a pair is
//         given up when what each leaves across its direction is far above the noise and still a
//         fair part of the motion, or far above what is known to be possible. Limits are wide: what
//         passes is judged by find_attachments().
#pragma once

#include <vector>

#include "kinematics/structure/link_path.h"

namespace kinescope::structure_search {

struct FirstLook {
  bool may_hang = true;  ///< by rest, a turn or a slide
  bool may_rest = true;  ///< as good as at rest (practical_rest())
};

/// `usable[c]`: channel c may be used. `give_up_above`: -2 ln likelihood a sample beyond which the
/// pair is of no interest.
[[nodiscard]] FirstLook first_look(const Body& body, const LinkPath& path, const Readings& readings,
                                   const std::vector<char>& usable, double give_up_above);

}  // namespace kinescope::structure_search
