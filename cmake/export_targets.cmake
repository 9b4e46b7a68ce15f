# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# find_package(nerf_pose_refiner) gives the target nerf_pose_refiner::nerf_pose_refiner, with and
# without ROS. With it, catkin_package() writes the package's configuration, which includes the
# targets' file through cmake/nerf_pose_refiner-extras.cmake.in.
include(CMakePackageConfigHelpers)
if(catkin_FOUND)
  set(npr_config_dir ${CATKIN_PACKAGE_SHARE_DESTINATION}/cmake)
  # For other packages of the same workspace, before anything is installed.
  export(EXPORT ${PROJECT_NAME}Targets NAMESPACE ${PROJECT_NAME}::
    FILE ${CATKIN_DEVEL_PREFIX}/${npr_config_dir}/${PROJECT_NAME}Targets.cmake)
else()
  #catkin_lint: skip
  set(npr_config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/${PROJECT_NAME})
  configure_package_config_file(
    cmake/${PROJECT_NAME}Config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}Config.cmake
    INSTALL_DESTINATION ${npr_config_dir})
  write_basic_package_version_file(
    ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}ConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES
    ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}Config.cmake
    ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}ConfigVersion.cmake
    DESTINATION ${npr_config_dir})
endif()
install(EXPORT ${PROJECT_NAME}Targets NAMESPACE ${PROJECT_NAME}:: DESTINATION ${npr_config_dir})
