# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# Messages, services and what this package gives to other catkin packages.
find_package(catkin REQUIRED COMPONENTS
  actionlib actionlib_msgs cv_bridge diagnostic_msgs diagnostic_updater dynamic_reconfigure
  geometry_msgs image_geometry image_transport interactive_markers message_filters
  message_generation nodelet pluginlib rosbag roscpp sensor_msgs std_msgs std_srvs tf2 tf2_msgs
  tf2_ros visualization_msgs)

add_action_files(FILES
  Register.action)
add_message_files(FILES
  CaptureStatus.msg
  ObjectDetection.msg
  ObjectInfo.msg
  PoseHypothesis.msg
  PoseHypothesisArray.msg
  RefinementStatus.msg)
add_service_files(FILES
  CalibrateCamera.srv
  DetectObject.srv
  ListObjects.srv
  LoadObject.srv
  RefinePose.srv
  RegisterObject.srv
  SetObject.srv
  UnloadObject.srv)
generate_messages(DEPENDENCIES actionlib_msgs geometry_msgs sensor_msgs std_msgs)

generate_dynamic_reconfigure_options(
  cfg/Overlay.cfg
  cfg/PoseRefiner.cfg
  cfg/Search.cfg
  cfg/Tracker.cfg)

# The module `ros` and the nodelet are plugins, not a library for others: only the library is given,
# by its name and as the target nerf_pose_refiner::nerf_pose_refiner.
catkin_package(
  INCLUDE_DIRS include
  LIBRARIES ${PROJECT_NAME}
  CFG_EXTRAS ${PROJECT_NAME}-extras.cmake
  CATKIN_DEPENDS actionlib_msgs geometry_msgs message_runtime roscpp sensor_msgs std_msgs
  DEPENDS EIGEN3)
