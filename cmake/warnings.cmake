# Warnings are errors for our own code; no contraction and no fast math, so that the same inputs give
# the same bits.
add_library(ulna_flags INTERFACE)
target_compile_options(ulna_flags INTERFACE
  -Wall -Wextra -Wshadow -Werror -ffp-contract=off
  $<$<COMPILE_LANGUAGE:CXX>:-Wconversion>)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 sees overlaps in assignments of string literals that there are not (its bug 105329).
  target_compile_options(ulna_flags INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-restrict>)
endif()
if(ULNA_SANITIZE)
  # Enough for a stack trace, and quick to compile. Checks at every access to a member double the time
  # that Eigen takes, and a null pointer is caught by the address sanitizer as well.
  target_compile_options(ulna_flags INTERFACE -fsanitize=address,undefined -fno-sanitize-recover=all
    -fno-sanitize=null,alignment,object-size,vptr -fno-omit-frame-pointer -g1 -O1)
  target_link_options(ulna_flags INTERFACE -fsanitize=address,undefined)
endif()
