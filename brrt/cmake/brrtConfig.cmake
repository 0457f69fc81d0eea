# The C++ headers of brrt, for `find_package(brrt CONFIG)`:
#   brrt::brrt  record a planner in C++17: #include <brrt/brrt.hpp>
#   brrt::ompl  record a planner of OMPL: #include <brrt/brrt_ompl.hpp>; only where OMPL is found
# Where it is: -Dbrrt_DIR="$(brrt include-dir --cmake-dir)".
get_filename_component(_brrt_include "${CMAKE_CURRENT_LIST_DIR}/../include" ABSOLUTE)

include(CMakeFindDependencyMacro)
find_dependency(Threads)

if(NOT TARGET brrt::brrt)
  add_library(brrt::brrt INTERFACE IMPORTED)
  target_include_directories(brrt::brrt INTERFACE "${_brrt_include}")
  target_compile_features(brrt::brrt INTERFACE cxx_std_17)
  target_link_libraries(brrt::brrt INTERFACE Threads::Threads)
endif()
unset(_brrt_include)

if(NOT brrt_FIND_COMPONENTS OR "ompl" IN_LIST brrt_FIND_COMPONENTS)
  find_package(ompl QUIET)
endif()
if(ompl_FOUND AND NOT TARGET brrt::ompl)
  add_library(brrt::ompl INTERFACE IMPORTED)
  # OMPL 1.6 has a target; before, its list names libraries that need not be installed.
  if(TARGET ompl::ompl)
    target_link_libraries(brrt::ompl INTERFACE brrt::brrt ompl::ompl)
  else()
    list(GET OMPL_LIBRARIES 0 _brrt_ompl)
    target_include_directories(brrt::ompl SYSTEM INTERFACE ${OMPL_INCLUDE_DIRS})
    target_link_libraries(brrt::ompl INTERFACE brrt::brrt ${_brrt_ompl})
    unset(_brrt_ompl)
  endif()
endif()

if(TARGET brrt::ompl)
  set(brrt_ompl_FOUND TRUE)
endif()
foreach(_brrt_component IN LISTS brrt_FIND_COMPONENTS)
  if(brrt_FIND_REQUIRED_${_brrt_component} AND NOT brrt_${_brrt_component}_FOUND)
    set(brrt_FOUND FALSE)
    set(brrt_NOT_FOUND_MESSAGE "brrt: ${_brrt_component} is not found; install libompl-dev")
  endif()
endforeach()
unset(_brrt_component)
