// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/grown_tree.h"

#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/find_attachments.h"

namespace kinescope::structure_search {
namespace {

void rename(int& link, const std::vector<int>& renamed) {
  if (link >= 0) link = renamed[static_cast<std::size_t>(link)];
}

}  // namespace

bool is_below(const GrownTree& tree, int link, std::size_t body) {
  for (int l = link; l >= 0; l = tree.link(l).parent) {
    if (tree.link(l).founder == static_cast<int>(body)) return true;
  }
  return false;
}

int own_link(const GrownTree& tree, std::size_t body) {
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    if (tree.links[l].founder == static_cast<int>(body)) return static_cast<int>(l);
  }
  return -1;
}

std::vector<int> remove_links_without_founder(GrownTree& tree) {
  std::vector<int> renamed(tree.links.size(), -1);
  std::vector<GrownLink> kept;
  for (std::size_t l = 0; l < tree.links.size(); ++l) {
    const int founder = tree.links[l].founder;
    if (founder >= 0 && tree.bodies[static_cast<std::size_t>(founder)].link != static_cast<int>(l))
      continue;
    renamed[l] = static_cast<int>(kept.size());
    kept.push_back(std::move(tree.links[l]));
    GrownLink& link = kept.back();
    if (link.parent < 0) continue;
    rename(link.parent, renamed);
    link.attachment.parent = link.parent;
  }
  tree.links = std::move(kept);
  for (GrownBody& body : tree.bodies) {
    body.alternatives.clear();
    rename(body.rests_on, renamed);
    if (body.link < 0) continue;
    rename(body.link, renamed);
    rename(body.attachment.parent, renamed);
  }
  return renamed;
}

std::vector<int> sort_links(GrownTree& tree) {
  std::vector<int> renamed(tree.links.size(), -1);
  std::vector<GrownLink> sorted;
  renamed[0] = 0;
  sorted.push_back(std::move(tree.links[0]));
  for (bool again = true; again;) {
    again = false;
    for (std::size_t l = 1; l < tree.links.size(); ++l) {
      if (renamed[l] >= 0 || renamed[static_cast<std::size_t>(tree.links[l].parent)] < 0) continue;
      renamed[l] = static_cast<int>(sorted.size());
      sorted.push_back(std::move(tree.links[l]));
      rename(sorted.back().parent, renamed);
      sorted.back().attachment.parent = sorted.back().parent;
      again = true;
    }
  }
  tree.links = std::move(sorted);
  for (GrownBody& body : tree.bodies) {
    // What a body hung on before it was released may be gone.
    if (body.link >= 0) rename(body.attachment.parent, renamed);
    rename(body.link, renamed);
    rename(body.rests_on, renamed);
    for (Attachment& a : body.alternatives) rename(a.parent, renamed);
  }
  return renamed;
}

GrownTree refit_tree(const GrownTree& tree, const Series& series, const Readings& readings) {
  GrownTree out = tree;
  out.links.front().path = camera_path(series.size());
  for (std::size_t l = 1; l < out.links.size(); ++l) {
    GrownLink& link = out.links[l];
    const auto founder = static_cast<std::size_t>(link.founder);
    const LinkPath& parent = out.link(link.parent).path;
    link.attachment = refit(link.attachment, series.bodies[founder], parent, readings);
    out.bodies[founder].attachment = link.attachment;
    link.path = path_of(link.attachment, series.bodies[founder], parent, readings);
  }
  for (std::size_t b = 0; b < out.bodies.size(); ++b) {
    GrownBody& body = out.bodies[b];
    if (body.link < 0 || !body.attachment.at_rest()) continue;
    body.attachment = refit(body.attachment, series.bodies[b], out.link(body.link).path, readings);
  }
  return out;
}

double tree_cost(const GrownTree& tree) {
  double sum = 0.0;
  for (const GrownBody& b : tree.bodies) sum += b.link < 0 ? b.free_cost : b.attachment.data_cost;
  return sum;
}

}  // namespace kinescope::structure_search
