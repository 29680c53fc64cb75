// SPDX-License-Identifier: Apache-2.0
//
// info.json of LeRobot datasets, with one episode of five frames.
#include "kinematics/datasets/dataset.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  static const std::filesystem::path folder = [] {
    const auto out = fuzz::file_of("", "any").parent_path();
    std::filesystem::create_directories(out / "meta");
    (void)fuzz::file_of("{\"episode_index\": 0, \"length\": 5}\n", "meta/episodes.jsonl");
    return out;
  }();
  (void)fuzz::file_of(fuzz::text_of(data, size), "meta/info.json");
  fuzz::expect_answer([&] {
    const datasets::Dataset dataset = datasets::read_dataset(folder);
    fuzz::expect_answer([&] { (void)datasets::choose_camera(dataset, {folder, {}, {}}); });
    for (const datasets::Episode& episode : dataset.episodes) {
      for (const auto& [camera, video] : episode.videos) {
        KINESCOPE_CHECK(video.file.string().starts_with(folder.string()),
                        "a path leads into the dataset");
      }
    }
  });
  return 0;
}
