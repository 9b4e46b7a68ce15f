// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/object_frame.h"

#include <gtest/gtest.h>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

/// U is 2 units above O and turned by a quarter about z; a unit is 0.1 m.
FieldMetadata someObject() {
  FieldMetadata object;
  object.metres_per_unit = 0.1;
  object.T_O_U = Pose(expSO3({0, 0, kPi / 2}), {0, 0, 2});
  return object;
}

TEST(ObjectFrame, PlacesTheUsersFrameByHand) {
  // A camera 5 units below O that looks up: it is 7 units from U.
  const Pose T_O_C(Eigen::Matrix3d::Identity(), {0, 0, -5});
  const ObjectFrame metres = ObjectFrame::inMetres(someObject());
  const Pose T_C_U = metres.objectInCamera(T_O_C);
  EXPECT_LT((T_C_U.t - Eigen::Vector3d(0, 0, 0.7)).norm(), 1e-15);
  EXPECT_LT((T_C_U.R * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  const Pose in_units = ObjectFrame::inModelUnits(someObject()).objectInCamera(T_O_C);
  EXPECT_LT((in_units.t - Eigen::Vector3d(0, 0, 7)).norm(), 1e-15);
  // The point (0, 1, 2) of the model is on U's x axis.
  EXPECT_LT((metres.point({0, 1, 2}) - Eigen::Vector3d(0.1, 0, 0)).norm(), 1e-15);
}

TEST(ObjectFrame, ThereAndBack) {
  const Pose T_O_C(expSO3({0.3, -1, 0.4}), {1, 2, -6});
  const ObjectFrame frame = ObjectFrame::inMetres(someObject());
  const Pose back = frame.cameraInModel(frame.objectInCamera(T_O_C));
  EXPECT_LT(rotationDistance(back.R, T_O_C.R), 1e-12);
  EXPECT_LT((back.t - T_O_C.t).norm(), 1e-12);
}

TEST(ObjectFrame, WithoutMetadataItIsTheModelsInMetres) {
  FieldMetadata object;
  object.metres_per_unit = 0.05;
  const Pose T_O_C(expSO3({0, kPi / 2, 0}), {4, 0, 0});
  // The camera's z axis is O's x axis: O is 4 units behind it.
  const Pose T_C_U = ObjectFrame::inMetres(object).objectInCamera(T_O_C);
  EXPECT_LT((T_C_U.t - Eigen::Vector3d(0, 0, -0.2)).norm(), 1e-15);
  EXPECT_LT(rotationDistance(T_C_U.R, T_O_C.R.transpose()), 1e-12);
}

TEST(BoxCorners, OfTheModelAreTurnedIntoTheUsersFrame) {
  Field field;
  field.metadata = someObject();
  field.box = {{0, 0, 0}, {1, 2, 3}};
  const auto corners = boxCorners(field, ObjectFrame::inMetres(field.metadata));
  EXPECT_LT((corners[0] - Eigen::Vector3d(0, 0, -0.2)).norm(), 1e-15);
  EXPECT_LT((corners[1] - Eigen::Vector3d(0, -0.1, -0.2)).norm(), 1e-15);  // O's x is U's -y
  EXPECT_LT((corners[7] - Eigen::Vector3d(0.2, -0.1, 0.1)).norm(), 1e-15);
}

TEST(BoxCorners, GivenOnesAreInTheUsersFrame) {
  Field field;
  field.metadata = someObject();
  field.metadata.box = Box{{-1, -2, 0}, {1, 2, 5}};
  const auto corners = boxCorners(field, ObjectFrame::inMetres(field.metadata));
  EXPECT_LT((corners[0] - Eigen::Vector3d(-0.1, -0.2, 0)).norm(), 1e-15);
  EXPECT_LT((corners[6] - Eigen::Vector3d(-0.1, 0.2, 0.5)).norm(), 1e-15);
}

}  // namespace
}  // namespace nerf_pose_refiner
