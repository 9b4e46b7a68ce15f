# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# What `cpack -G DEB` packs (scripts/make_debian_package): one package for users, robots and
# developers. Shared libraries that it needs are found by dpkg-shlibdeps; what cannot be seen in
# binaries stands here.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME ros-nerf-pose-refiner)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "The ${PROJECT_NAME} authors <${PROJECT_NAME}@users.noreply.github.com>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "6-DoF pose of a known object by a learned radiance field")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS
  "catkin, libactionlib-msgs-dev, libeigen3-dev, libgeometry-msgs-dev, libnodeletlib-tools, libroscpp-dev, \
libsensor-msgs-dev, libstd-msgs-dev, pluginlib-dev, python3-diagnostic-msgs, python3-dynamic-reconfigure, \
python3-geometry-msgs, python3-interactive-markers, python3-matplotlib, python3-numpy, python3-opencv, \
python3-rosbag, python3-rosgraph, python3-roslaunch, python3-rospy, python3-sensor-msgs, python3-std-msgs, \
python3-std-srvs, python3-tf2-ros, python3-visualization-msgs, ros-message-runtime")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-rosservice, python3-rostopic, rosbash")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "rviz")
include(CPack)
