# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
# The modules that the library is made of: folders of src/, an object library each.

# npr_add_module(module [THREADED] USES modules... LIBRARIES libraries... SOURCES sources...)
# Called in the module's folder. It may include headers of the modules that it uses, which were added
# before it, and of its libraries: test/test_modules.py reads USES, and checks every include.
# LIBRARIES: those whose headers are included, beside Eigen's and OpenMP's.
# THREADED: it starts threads or is called from several, so that ThreadSanitizer must watch it.
function(npr_add_module module)
  cmake_parse_arguments(arg "THREADED" "" "USES;LIBRARIES;SOURCES" ${ARGN})
  get_property(above GLOBAL PROPERTY npr_modules)
  foreach(used ${arg_USES})
    if(NOT used IN_LIST above)
      message(FATAL_ERROR "The module ${module} uses ${used}, which is not above it.")
    endif()
  endforeach()
  set_property(GLOBAL APPEND PROPERTY npr_modules ${module})
  if(NOT arg_SOURCES)
    return()  # headers alone
  endif()
  set(target ${PROJECT_NAME}_${module})
  add_library(${target} OBJECT ${arg_SOURCES})
  npr_set_warnings(${target})
  if(NERF_POSE_REFINER_FAST_BUILD)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O3>)
  endif()
  if(NOT arg_THREADED)
    target_compile_options(${target} PRIVATE ${NERF_POSE_REFINER_NUMERICS_FLAGS})
  endif()
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/include ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${target} PRIVATE Eigen3::Eigen OpenMP::OpenMP_CXX ${arg_LIBRARIES})
  if(module STREQUAL concurrency OR (NERF_POSE_REFINER_NUMERICS_FLAGS AND NOT arg_THREADED))
    npr_precompile(${target})  # the first that has sources, or one with flags of its own
  else()
    npr_reuse_precompiled(${target} ${PROJECT_NAME}_concurrency)
  endif()
  npr_join_sources(${target})
  target_sources(${PROJECT_NAME} PRIVATE $<TARGET_OBJECTS:${target}>)
endfunction()

# npr_add_kernels(module kernels...): <kernel>_baseline.cpp and, on x86-64, <kernel>_avx2.cpp, which is
# chosen at run time. No other file is compiled for more than the compiler's default processor.
function(npr_add_kernels module)
  set(target ${PROJECT_NAME}_${module})
  set(baseline ${ARGN})
  list(TRANSFORM baseline APPEND _baseline.cpp)
  set(sources ${baseline})
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64|amd64" AND CMAKE_SIZEOF_VOID_P EQUAL 8)
    set(avx2 ${ARGN})
    list(TRANSFORM avx2 APPEND _avx2.cpp)
    list(APPEND sources ${avx2})
    target_compile_definitions(${target} PRIVATE NPR_HAVE_AVX2)
    set_property(SOURCE ${avx2} APPEND PROPERTY COMPILE_OPTIONS -mavx2 -mfma -mf16c)
  endif()
  target_sources(${target} PRIVATE ${sources})
  set_property(SOURCE ${sources} APPEND PROPERTY COMPILE_OPTIONS -ffp-contract=fast)
  set_property(SOURCE ${sources} PROPERTY SKIP_PRECOMPILE_HEADERS ON)
endfunction()
