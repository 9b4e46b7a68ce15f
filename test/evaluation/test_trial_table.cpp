// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial_table.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <sstream>

#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

TrialKey keyOf(int view, int start) {
  return {"e", "mug", "synthetic", "single", "l2", "", "clean", "paper", view, start};
}

std::string contents(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

const std::string kHeader =
    "experiment,scene,kind,method,loss,variant,condition,protocol,view,start,deg,units\n";

TEST(TrialTable, goesOnWhereItWasLeft) {
  const TemporaryFolder folder;
  const std::string path = folder.file("trials.csv");
  {
    TrialTable table(path, {"deg", "units"});
    table.add(keyOf(0, 1), {{"1.5", "0.25"}});
    EXPECT_TRUE(table.has(keyOf(0, 1)));
    EXPECT_FALSE(table.has(keyOf(1, 0)));
  }
  const std::string one = kHeader + "e,mug,synthetic,single,l2,,clean,paper,0,1,1.5,0.25\n";
  EXPECT_EQ(contents(path), one);
  TrialTable table(path, {"deg", "units"});
  EXPECT_TRUE(table.has(keyOf(0, 1)));
  table.add(keyOf(1, 0), {{"2", ""}, {"3", ""}});
  EXPECT_EQ(table.size(), 2u);
  EXPECT_EQ(contents(path), one + "e,mug,synthetic,single,l2,,clean,paper,1,0,2,\n" +
                                "e,mug,synthetic,single,l2,,clean,paper,1,0,3,\n");
}

TEST(TrialTable, halfALineIsCutOff) {
  const TemporaryFolder folder;
  const std::string path = folder.file("trials.csv");
  TrialTable(path, {"deg", "units"}).add(keyOf(0, 1), {{"1.5", "0.25"}});
  const std::string whole = contents(path);
  std::ofstream(path, std::ios::app) << "e,mug,synthetic,single,l2,,clean,paper,0,2,1.";
  TrialTable table(path, {"deg", "units"});
  EXPECT_FALSE(table.has(keyOf(0, 2)));
  EXPECT_EQ(contents(path), whole);
}

TEST(TrialTable, halfAHeaderIsBegunAnew) {
  const TemporaryFolder folder;
  for (const std::string& begun : {std::string(), kHeader.substr(0, 30)}) {
    const std::string path = folder.write("trials.csv", begun);
    TrialTable(path, {"deg", "units"});
    EXPECT_EQ(contents(path), kHeader);
  }
}

TEST(TrialTable, anotherTableIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("trials.csv");
  TrialTable(path, {"deg", "units"});
  expectError<std::runtime_error>([&] { TrialTable(path, {"deg"}); }, "another table");
  std::ofstream(path) << "half a header";
  expectError<std::runtime_error>([&] { TrialTable(path, {"deg"}); }, "holds no table");
  expectError<std::runtime_error>([&] { TrialTable(folder.file("x") + "/no.csv", {"deg"}); },
                                  "cannot write");
}

TEST(TrialTable, cells) {
  EXPECT_EQ(cellOf(0.1), "0.1");
  EXPECT_EQ(cellOf(1.0 / 3), "0.333333333");
  EXPECT_EQ(cellOf(std::numeric_limits<double>::infinity()), "");
}

}  // namespace
}  // namespace nerf_pose_refiner
