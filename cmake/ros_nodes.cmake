# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# The module `ros`, the nodelet and the nodes, and the files that are installed with them.
set(ros_library ${PROJECT_NAME}_ros)
add_library(${ros_library} STATIC
  src/ros/bag/bag_companion.cpp
  src/ros/bag/bag_images.cpp
  src/ros/bag/bag_sequence.cpp
  src/ros/capture/capture_node.cpp
  src/ros/capture/view_capture.cpp
  src/ros/conversions/camera_input.cpp
  src/ros/conversions/companion_pairing.cpp
  src/ros/conversions/depth_input.cpp
  src/ros/conversions/detection_boxes.cpp
  src/ros/conversions/mask_pairing.cpp
  src/ros/conversions/param_reader.cpp
  src/ros/conversions/parameters.cpp
  src/ros/conversions/pose_conversions.cpp
  src/ros/conversions/pose_markers.cpp
  src/ros/conversions/status.cpp
  src/ros/conversions/tf_bridge.cpp
  src/ros/nodelet/camera_subscription.cpp
  src/ros/nodelet/diagnostics.cpp
  src/ros/nodelet/frame_conflict.cpp
  src/ros/nodelet/frame_input.cpp
  src/ros/nodelet/initial_pose_marker.cpp
  src/ros/nodelet/message_tracker.cpp
  src/ros/nodelet/overlay_publisher.cpp
  src/ros/nodelet/result_publisher.cpp
  src/ros/nodelet/tracking_worker.cpp
  src/ros/nodelet/transform_input.cpp
  src/ros/services/calibration_service.cpp
  src/ros/services/detection_service.cpp
  src/ros/services/image_service.cpp
  src/ros/services/next_image.cpp
  src/ros/services/object_services.cpp
  src/ros/services/pose_service.cpp
  src/ros/services/reconfiguration.cpp
  src/ros/services/registration_services.cpp)
add_dependencies(${ros_library}
  ${PROJECT_NAME}_gencfg ${PROJECT_NAME}_generate_messages_cpp ${catkin_EXPORTED_TARGETS})
npr_set_warnings(${ros_library})
npr_precompile(${ros_library} <ros/ros.h> <sensor_msgs/CameraInfo.h> <sensor_msgs/Image.h>)
npr_join_sources(${ros_library}
  src/ros/capture/capture_node.cpp src/ros/services/reconfiguration.cpp)
# GCC 12 takes Boost's precompiled headers for the package's own, and warns of them.
set_source_files_properties(src/ros/capture/capture_node.cpp PROPERTIES
  SKIP_PRECOMPILE_HEADERS ON)
set_target_properties(${ros_library} PROPERTIES POSITION_INDEPENDENT_CODE ON)  # of the nodelets
# Private to this package.
#catkin_lint: ignore_once external_interface_path
target_include_directories(${ros_library} SYSTEM PUBLIC ${catkin_INCLUDE_DIRS})
target_include_directories(${ros_library} SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
target_link_libraries(${ros_library} PUBLIC ${npr_internal} ${catkin_LIBRARIES})

add_library(${PROJECT_NAME}_nodelets SHARED src/ros/nodelet/pose_refiner_nodelet.cpp)
npr_set_warnings(${PROJECT_NAME}_nodelets)
target_link_libraries(${PROJECT_NAME}_nodelets PRIVATE ${ros_library})

# Called `pose_refiner` in the package's own folder (rosrun nerf_pose_refiner pose_refiner).
foreach(node decode_images initial_pose_marker pose_refiner)
  add_executable(${PROJECT_NAME}_${node}_node src/ros/nodelet/${node}_node.cpp)
  set_target_properties(${PROJECT_NAME}_${node}_node PROPERTIES OUTPUT_NAME ${node})
  npr_set_warnings(${PROJECT_NAME}_${node}_node)
  target_include_directories(${PROJECT_NAME}_${node}_node PRIVATE src)
  target_include_directories(${PROJECT_NAME}_${node}_node SYSTEM PRIVATE
    ${catkin_INCLUDE_DIRS} ${OpenCV_INCLUDE_DIRS})
  target_link_libraries(${PROJECT_NAME}_${node}_node PRIVATE ${catkin_LIBRARIES} ${OpenCV_LIBS})
  install(TARGETS ${PROJECT_NAME}_${node}_node RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endforeach()

target_link_libraries(${PROJECT_NAME}_initial_pose_marker_node PRIVATE ${ros_library})

# Tools that read bags need ROS. The script of the evaluation is installed beside them.
if(CLI11_FOUND)
  npr_add_tool(check_trust src/ros/bag/check_trust.cpp src/ros/bag/trust_trials.cpp)
  npr_add_tool(evaluate_bag src/ros/bag/bag_evaluation.cpp src/ros/bag/evaluate_bag.cpp
    src/ros/bag/evaluation_files.cpp)
  foreach(tool check_trust evaluate_bag)
    target_link_libraries(${PROJECT_NAME}_${tool} PRIVATE ${tools} ${ros_library})
    npr_reuse_precompiled(${PROJECT_NAME}_${tool} ${tools})
    npr_join_sources(${PROJECT_NAME}_${tool})
  endforeach()
endif()
catkin_install_python(PROGRAMS
  scripts/choose_box scripts/compare_sensors scripts/evaluate_bop scripts/llff_to_transforms
  scripts/make_board scripts/photos_to_object scripts/plot_evaluation
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY scripts/lib/photos DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION}/lib
  FILES_MATCHING PATTERN "*.py" PATTERN __pycache__ EXCLUDE)
install(FILES scripts/lib/evaluation_frames.py DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION}/lib)

add_executable(${PROJECT_NAME}_capture_views_node src/ros/capture/capture_views_node.cpp)
set_target_properties(${PROJECT_NAME}_capture_views_node PROPERTIES OUTPUT_NAME capture_views)
npr_set_warnings(${PROJECT_NAME}_capture_views_node)
target_link_libraries(${PROJECT_NAME}_capture_views_node PRIVATE ${ros_library})
install(TARGETS ${PROJECT_NAME}_capture_views_node
  RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})

install(TARGETS ${PROJECT_NAME}_nodelets
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
install(FILES nodelet_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY config launch rviz DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
# The photos that demo.launch learns from, and the recording in which it tracks.
install(DIRECTORY demo/data/toy_kiosk DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/demo/data)
install(FILES demo/toy_kiosk.bag demo/toy_kiosk_companions.bag
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/demo)
