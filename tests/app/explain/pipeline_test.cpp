// SPDX-License-Identifier: Apache-2.0
#include "app/explain/pipeline.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(Pipeline, ARemedyNamesFilesThatTheRecordingHas) {
  EXPECT_EQ(model_remedy(RecordingEntry::kPoses, false).find("camera"), std::string::npos);
  EXPECT_EQ(model_remedy(RecordingEntry::kPoses, false).find("tags.yaml"), std::string::npos);
  EXPECT_EQ(model_remedy(RecordingEntry::kVideo, false).find("camera.yaml"), std::string::npos);
  EXPECT_NE(model_remedy(RecordingEntry::kVideo, true).find("camera.yaml"), std::string::npos);
  EXPECT_NE(model_remedy(RecordingEntry::kVideo, true).find("tags.yaml"), std::string::npos);
}

}  // namespace
}  // namespace kinescope
