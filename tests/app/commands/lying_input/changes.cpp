// SPDX-License-Identifier: Apache-2.0
#include "tests/app/commands/lying_input/changes.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/lying_input/sound_recordings.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::lying {
namespace {

namespace fs = std::filesystem;

std::size_t index_of(const Files& files, const std::string& file, const std::string& column) {
  const Row header = rows_of(files.at(file)).front();
  return static_cast<std::size_t>(std::ranges::find(header, column) - header.begin());
}

}  // namespace

std::vector<Row> rows_of(const std::string& text) {
  std::vector<Row> rows(1, Row(1));
  for (const char c : text) {
    if (c == '\n') {
      rows.emplace_back(1);
    } else if (c == ',') {
      rows.back().emplace_back();
    } else {
      rows.back().back() += c;
    }
  }
  rows.pop_back();
  return rows;
}

Change each_row(const std::string& file, const std::function<void(Row&, int)>& edit) {
  return [=](Files& files) {
    std::vector<Row> rows = rows_of(files.at(file));
    std::string text = fmt::format("{}\n", fmt::join(rows.front(), ","));
    for (std::size_t i = 1; i < rows.size(); ++i) {
      edit(rows[i], static_cast<int>(i) - 1);
      if (!rows[i].empty()) text += fmt::format("{}\n", fmt::join(rows[i], ","));
    }
    files[file] = text;
  };
}

Change column(const std::string& file, const std::string& name,
              const std::function<double(double, int)>& value) {
  return [=](Files& files) {
    const std::size_t at = index_of(files, file, name);
    each_row(file, [&](Row& row, int i) {
      row.at(at) = fmt::format("{}", value(std::stod(row.at(at)), i));
    })(files);
  };
}

Change columns_exchanged(const std::string& file, const std::string& a, const std::string& b) {
  return [=](Files& files) {
    const std::size_t first = index_of(files, file, a);
    const std::size_t second = index_of(files, file, b);
    each_row(file, [&](Row& row, int) { std::swap(row.at(first), row.at(second)); })(files);
  };
}

Change is(const std::string& file, const std::string& text) {
  return [=](Files& files) { files[file] = text; };
}

Change without(const std::string& file) {
  return [=](Files& files) { files.erase(file); };
}

Change with(const std::string& file, const std::string& from, const std::string& to) {
  return [=](Files& files) {
    std::string& text = files.at(file);
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
  };
}

Change all_of(const std::vector<Change>& changes) {
  return [=](Files& files) {
    for (const Change& change : changes) change(files);
  };
}

Change none() {
  return [](Files&) {};
}

Change log_late(int first, int end, int rows) {
  return [=](Files& files) {
    const std::vector<Row> log = rows_of(files.at("joints.csv"));
    each_row("joints.csv", [&](Row& row, int i) {
      if (i < first || i >= end) return;
      const Row& before = log[static_cast<std::size_t>(i - rows)];
      std::copy(before.begin() + 1, before.end(), row.begin() + 1);
    })(files);
  };
}

Change marker_fallen(const std::string& body, double from_s) {
  return [=](Files& files) {
    Row where;
    each_row("poses.csv", [&](Row& row, int) {
      if (row[1] != body || std::stod(row[0]) < from_s) return;
      if (where.empty()) where = row;
      std::copy(where.begin() + 2, where.end(), row.begin() + 2);
    })(files);
  };
}

Change first_joint(const std::function<void(Joint&)>& edit) {
  return [=](Files& files) {
    const fs::path path = truth::temporary_path("lying_input.urdf");
    write_file_atomically(path, files.at("nominal.urdf"));
    KinematicTree tree = read_urdf(path);
    fs::remove(path);
    edit(tree.joints.front());
    files["nominal.urdf"] = write_urdf(tree);
  };
}

Change poses_as(const std::function<Pose(const Pose&)>& other) {
  return [=](Files& files) {
    PoseTracks tracks = poses_of({}).tracks;
    for (PoseTrack& track : tracks.tracks) {
      for (PoseSample& sample : track.samples)
        sample.T_camera_marker = other(sample.T_camera_marker);
    }
    files["poses.csv"] = tracks_csv(tracks);
  };
}

Change without_column(const std::string& file, const std::string& name) {
  return [=](Files& files) {
    const auto at = static_cast<std::ptrdiff_t>(index_of(files, file, name));
    std::string text;
    for (Row& row : rows_of(files.at(file))) {
      row.erase(row.begin() + at);
      text += fmt::format("{}\n", fmt::join(row, ","));
    }
    files[file] = text;
  };
}

Change with_all(const std::string& file, const std::string& from, const std::string& to) {
  return [=](Files& files) {
    std::string& text = files.at(file);
    for (std::size_t at = text.find(from); at != std::string::npos;
         at = text.find(from, at + to.size())) {
      text.replace(at, from.size(), to);
    }
  };
}

}  // namespace kinescope::lying
