# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# The CUDA backend, where a CUDA compiler is found. Its objects are part of the library, and CUDA's
# runtime is linked statically: users of this package do not link CUDA. Its sources are in cuda/.
#
# CMAKE_CUDA_ARCHITECTURES chooses the GPUs that it is compiled for. By default all from 7.5 to 9.0,
# and code that later ones compile themselves.
include(CheckLanguage)
if(CMAKE_VERSION VERSION_LESS 3.18)
  message(STATUS "No CUDA backend: it needs CMake 3.18, this is ${CMAKE_VERSION}")
  return()
endif()
check_language(CUDA)
if(NOT CMAKE_CUDA_COMPILER)
  message(STATUS "No CUDA backend: there is no CUDA compiler (set CUDACXX to an nvcc)")
  return()
endif()
# Asked before the language is enabled, for an old compiler fails at that.
execute_process(COMMAND ${CMAKE_CUDA_COMPILER} --version
  OUTPUT_VARIABLE npr_nvcc_version ERROR_QUIET)
string(REGEX MATCH "release [0-9]+\\.[0-9]+" npr_nvcc_version "${npr_nvcc_version}")
string(REPLACE "release " "" npr_nvcc_version "${npr_nvcc_version}")
if(npr_nvcc_version VERSION_LESS 11.8)
  message(STATUS "No CUDA backend: it needs CUDA 11.8, ${CMAKE_CUDA_COMPILER} is of "
    "'${npr_nvcc_version}'")
  return()
endif()
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
  # Named, for a container's build has no GPU to ask.
  set(CMAKE_CUDA_ARCHITECTURES 75-real 80-real 86-real 87-real 89-real 90)
endif()
enable_language(CUDA)
find_package(CUDAToolkit REQUIRED)
message(STATUS "CUDA backend: ${CMAKE_CUDA_COMPILER_VERSION}, for ${CMAKE_CUDA_ARCHITECTURES}")

# Language and warnings of a target with kernels.
function(npr_set_cuda_options target)
  npr_set_warnings(${target})
  set_target_properties(${target} PROPERTIES
    CUDA_STANDARD 17 CUDA_STANDARD_REQUIRED ON CUDA_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CUDA>:--expt-relaxed-constexpr -Xcompiler=-Wall,-Wextra>
    $<$<AND:$<COMPILE_LANGUAGE:CUDA>,$<BOOL:${NERF_POSE_REFINER_WERROR}>>:-Werror=all-warnings
      -Xcompiler=-Werror>)
endfunction()

set(npr_cuda ${PROJECT_NAME}_cuda)
add_library(${npr_cuda} OBJECT
  cuda/align.cu
  cuda/contrast.cu
  cuda/cuda_align.cpp
  cuda/cuda_backend.cpp
  cuda/cuda_descriptor_index.cpp
  cuda/cuda_error.cpp
  cuda/cuda_field.cpp
  cuda/cuda_frame.cpp
  cuda/cuda_frame_pyramid.cpp
  cuda/cuda_keyframe.cpp
  cuda/cuda_keyframe_aligner.cpp
  cuda/cuda_loaded_field.cpp
  cuda/cuda_observe.cpp
  cuda/cuda_optimise.cpp
  cuda/cuda_processor.cpp
  cuda/cuda_solver.cpp
  cuda/cuda_template_matcher.cpp
  cuda/cuda_trainer.cpp
  cuda/descent_update.cu
  cuda/descriptor_search.cu
  cuda/evaluate.cu
  cuda/gpu_memory.cpp
  cuda/hypotheses.cu
  cuda/image_level.cu
  cuda/image_pyramid.cu
  cuda/keyframe_align.cu
  cuda/launch.cpp
  cuda/optimise.cu
  cuda/probe.cu
  cuda/regions.cu
  cuda/render.cu
  cuda/template_fit.cu
  cuda/template_responses.cu
  cuda/template_scan.cu
  cuda/train_networks.cu
  cuda/train_occupancy.cu
  cuda/train_rays.cu
  cuda/train_update.cu)
npr_set_cuda_options(${npr_cuda})
# Responses to templates are those of the CPU on x86-64, bit for bit; places but for the last bits
# of sines.
set_property(SOURCE cuda/template_fit.cu cuda/template_responses.cu cuda/template_scan.cu
  PROPERTY COMPILE_OPTIONS -fmad=false)
npr_precompile(${npr_cuda})
if(NERF_POSE_REFINER_FAST_BUILD)
  target_compile_options(${npr_cuda} PRIVATE $<$<AND:$<CONFIG:Release>,$<COMPILE_LANGUAGE:CXX>>:-O3>)
endif()
target_include_directories(${npr_cuda} PRIVATE include src)
target_link_libraries(${npr_cuda} PRIVATE Eigen3::Eigen CUDA::cudart_static OpenMP::OpenMP_CXX)
target_sources(${PROJECT_NAME} PRIVATE $<TARGET_OBJECTS:${npr_cuda}>)
set_target_properties(${PROJECT_NAME} PROPERTIES CUDA_ARCHITECTURES "${CMAKE_CUDA_ARCHITECTURES}")
target_link_libraries(${PROJECT_NAME} PRIVATE CUDA::cudart_static)
target_compile_definitions(${PROJECT_NAME}_backend PRIVATE NPR_HAVE_CUDA)
