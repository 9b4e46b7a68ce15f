# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# The CUDA engine, where a CUDA compiler is found.
include(CheckLanguage)
check_language(CUDA)
if(CMAKE_CUDA_COMPILER)
  if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
    set(CMAKE_CUDA_ARCHITECTURES 75 80 86)  # named, for a container's build has no GPU to ask
  endif()
  enable_language(CUDA)
  find_package(CUDAToolkit REQUIRED)
  add_library(${PROJECT_NAME}_cuda STATIC ${NPR_CUDA_SOURCES})
  target_include_directories(${PROJECT_NAME}_cuda PRIVATE include)
  target_link_libraries(${PROJECT_NAME}_cuda PRIVATE CUDA::cudart_static)
  target_link_libraries(${PROJECT_NAME} PRIVATE ${PROJECT_NAME}_cuda)
  target_compile_definitions(${PROJECT_NAME} PRIVATE NPR_HAVE_CUDA)
endif()
