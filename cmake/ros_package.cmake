# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# Messages, services and what this package gives to other catkin packages.
find_package(catkin REQUIRED COMPONENTS
  cv_bridge diagnostic_msgs diagnostic_updater dynamic_reconfigure geometry_msgs image_geometry
  image_transport interactive_markers message_generation nodelet pluginlib rosbag roscpp
  sensor_msgs std_msgs std_srvs tf2 tf2_msgs tf2_ros visualization_msgs)

add_message_files(FILES
  PoseHypothesis.msg
  PoseHypothesisArray.msg
  RefinementStatus.msg)
add_service_files(FILES
  LoadObject.srv
  RegisterObject.srv)
generate_messages(DEPENDENCIES geometry_msgs std_msgs)

generate_dynamic_reconfigure_options(
  cfg/Overlay.cfg
  cfg/PoseRefiner.cfg
  cfg/Search.cfg
  cfg/Tracker.cfg)

# The room `ros` and the nodelet are plugins, not a library for others: only the library is given.
catkin_package(
  INCLUDE_DIRS include
  LIBRARIES ${PROJECT_NAME}
  CATKIN_DEPENDS geometry_msgs message_runtime roscpp std_msgs
  DEPENDS EIGEN3)
