// SPDX-License-Identifier: Apache-2.0
//
// A tree of links under search, with every body on one of them or free, and what else was looked
// at. Links are renumbered here and nowhere else.
#pragma once

#include <vector>

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

struct GrownLink {
  int parent = -1;        ///< link; -1 for the camera's
  int founder = -1;       ///< body whose marker frame is the link's frame; -1 for the camera's
  Attachment attachment;  ///< of the founder on the parent
  LinkPath path;
};

struct GrownBody {
  int link = -1;                         ///< -1: free
  Attachment attachment;                 ///< on `link` at rest, or the founder's
  std::vector<Attachment> alternatives;  ///< all looked at (against all links), without paths
  double free_cost = 0.0;                ///< of moving freely, along whatever directions were seen
  double everywhere_cost = 0.0;          ///< of moving freely, as far in every direction
  int rests_on = -1;                     ///< link on which it plainly rests; -1: on none
};

/// Another whole tree that was looked at, in which a body hangs elsewhere, and others with it.
struct RivalTree {
  std::size_t body = 0;
  double loss = 0.0;  ///< -2 ln odds against this tree
};

struct GrownTree {
  std::vector<GrownLink> links;   ///< parents before children
  std::vector<GrownBody> bodies;  ///< as in the series
  std::vector<RivalTree> rivals;

  [[nodiscard]] GrownLink& link(int l) { return links[static_cast<std::size_t>(l)]; }
  [[nodiscard]] const GrownLink& link(int l) const { return links[static_cast<std::size_t>(l)]; }
  /// Body that founded a link other than the camera's.
  [[nodiscard]] std::size_t founder_of(int l) const {
    return static_cast<std::size_t>(link(l).founder);
  }
};

/// Link `link` hangs (at any depth) on the link that body `body` founded, or is it.
[[nodiscard]] bool is_below(const GrownTree& tree, int link, std::size_t body);

/// The link that the body founded; -1: none.
[[nodiscard]] int own_link(const GrownTree& tree, std::size_t body);

/// Takes out the links whose founders stand elsewhere by now, and all alternatives. Gives the new
/// number of every link, -1 for those that are gone.
std::vector<int> remove_links_without_founder(GrownTree& tree);

/// Puts parents before children again after a link has changed its parent. Gives the new number of
/// every link.
[[nodiscard]] std::vector<int> sort_links(GrownTree& tree);

/// The same tree with all models refitted to other readings (another time offset).
[[nodiscard]] GrownTree refit_tree(const GrownTree& tree, const Series& series,
                                   const Readings& readings);

/// Sum of the bodies' data costs.
[[nodiscard]] double tree_cost(const GrownTree& tree);

}  // namespace kinescope::structure_search
