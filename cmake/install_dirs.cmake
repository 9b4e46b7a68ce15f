# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# Where things are installed: as GNU does, or as catkin does in a catkin workspace.
include(GNUInstallDirs)
set(NPR_INSTALL_LIB_DIR ${CMAKE_INSTALL_LIBDIR})
set(NPR_INSTALL_TOOL_DIR ${CMAKE_INSTALL_BINDIR})
set(NPR_INSTALL_INCLUDE_DIR ${CMAKE_INSTALL_INCLUDEDIR})
if(catkin_FOUND)
  set(NPR_INSTALL_LIB_DIR ${CATKIN_PACKAGE_LIB_DESTINATION})
  set(NPR_INSTALL_TOOL_DIR ${CATKIN_PACKAGE_BIN_DESTINATION})
  set(NPR_INSTALL_INCLUDE_DIR ${CATKIN_GLOBAL_INCLUDE_DESTINATION})
endif()
