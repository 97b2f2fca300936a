#include "tests/fuzz/largest_allocation.h"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace rotslam {

std::size_t largest_allocation = 0;

}  // namespace rotslam

void* operator new(std::size_t size) {
  rotslam::largest_allocation = std::max(rotslam::largest_allocation, size);
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
// Address sanitizer's own would not match the operators below.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  rotslam::largest_allocation = std::max(rotslam::largest_allocation, size);
  return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
