#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <type_traits>

namespace fontcore {

/// A list that keeps up to N entries in itself and asks the heap for memory beyond that only.
///
/// Rules are rows of a few terms, by the hundred for every glyph: as lists on the heap they took a third of the time of
/// a restyled font.
template <typename T, std::size_t N>
class InlineVector {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  using value_type = T;

  InlineVector() = default;
  InlineVector(std::initializer_list<T> values) { assign(values.begin(), values.size()); }
  InlineVector(const InlineVector& other) { assign(other.begin(), other.size()); }
  InlineVector(InlineVector&& other) noexcept { take(other); }
  InlineVector& operator=(const InlineVector& other) {
    if (this != &other) assign(other.begin(), other.size());
    return *this;
  }
  InlineVector& operator=(InlineVector&& other) noexcept {
    if (this != &other) take(other);
    return *this;
  }
  ~InlineVector() = default;

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* begin() { return heap_ ? heap_.get() : inline_.data(); }
  T* end() { return begin() + size_; }
  const T* begin() const { return heap_ ? heap_.get() : inline_.data(); }
  const T* end() const { return begin() + size_; }
  T& operator[](std::size_t index) { return begin()[index]; }
  const T& operator[](std::size_t index) const { return begin()[index]; }
  const T& front() const { return *begin(); }
  const T& back() const { return end()[-1]; }
  T& back() { return end()[-1]; }

  void clear() { size_ = 0; }
  void push_back(const T& value) { insert(end(), value); }
  /// Before `at`.
  void insert(T* at, const T& value) {
    const T copy = value;
    const auto index = static_cast<std::size_t>(at - begin());
    if (size_ == capacity_) reserve(2 * capacity_);
    std::copy_backward(begin() + index, end(), end() + 1);
    begin()[index] = copy;
    ++size_;
  }
  void erase(T* at) { erase(at, at + 1); }
  void erase(T* from, T* to) { size_ = static_cast<std::size_t>(std::copy(to, end(), from) - begin()); }

 private:
  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    auto more = std::make_unique_for_overwrite<T[]>(capacity);
    std::copy(begin(), end(), more.get());
    heap_ = std::move(more);
    capacity_ = capacity;
  }
  void assign(const T* from, std::size_t count) {
    size_ = 0;
    reserve(count);
    std::copy_n(from, count, begin());
    size_ = count;
  }
  void take(InlineVector& other) {
    heap_ = std::move(other.heap_);
    size_ = other.size_;
    capacity_ = other.capacity_;
    if (!heap_) std::copy_n(other.inline_.data(), size_, inline_.data());
    other.size_ = 0;
    other.capacity_ = N;
  }

  std::unique_ptr<T[]> heap_;  // none while the entries fit into the list itself
  std::size_t size_ = 0;
  std::size_t capacity_ = N;
  std::array<T, N> inline_;
};

}  // namespace fontcore
