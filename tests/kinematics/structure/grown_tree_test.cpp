// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/grown_tree.h"

#include <gtest/gtest.h>

namespace kinescope::structure_search {
namespace {

// Body b on link b + 1, which hangs on the link that is given; link 0 is the camera's.
GrownTree tree_of(const std::vector<int>& parents) {
  GrownTree tree;
  tree.links.emplace_back();
  for (std::size_t b = 0; b < parents.size(); ++b) {
    GrownLink link;
    link.parent = parents[b];
    link.founder = static_cast<int>(b);
    link.attachment.parent = parents[b];
    tree.links.push_back(link);
    GrownBody body;
    body.link = static_cast<int>(b) + 1;
    body.attachment.parent = parents[b];
    tree.bodies.push_back(body);
  }
  return tree;
}

TEST(SortLinks, ParentsComeFirstAndBodiesFollow) {
  GrownTree tree = tree_of({2, 0, 1});
  Attachment other;
  other.parent = 3;
  tree.bodies[1].alternatives.push_back(other);
  tree.bodies[2].rests_on = 2;
  EXPECT_EQ(sort_links(tree), (std::vector<int>{0, 2, 1, 3}));
  EXPECT_EQ(tree.links[1].founder, 1);
  EXPECT_EQ(tree.links[2].parent, 1);
  EXPECT_EQ(tree.links[3].parent, 2);
  EXPECT_EQ(tree.bodies[0].link, 2);
  EXPECT_EQ(tree.bodies[0].attachment.parent, 1);
  EXPECT_EQ(tree.bodies[1].alternatives.front().parent, 3);
  EXPECT_EQ(tree.bodies[2].rests_on, 1);
}

// The link on which it hung before it was released has been taken out.
TEST(SortLinks, AFreeBodyHangsNowhere) {
  GrownTree tree = tree_of({2, 0});
  GrownBody free;
  free.attachment.parent = 1 << 20;
  tree.bodies.push_back(free);
  EXPECT_EQ(sort_links(tree), (std::vector<int>{0, 2, 1}));
  EXPECT_EQ(tree.bodies.back().link, -1);
}

}  // namespace
}  // namespace kinescope::structure_search
