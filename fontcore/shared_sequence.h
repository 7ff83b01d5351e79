#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include "fontcore/measure.h"

namespace fontcore {

/// Entries in order of their t, whose copies share what they have in common: a changed copy costs the entries changed
/// and one pointer for every few dozen others.
///
/// `Entry` has a member t, and `void add_to(Box&) const` adds the points it holds to a box.
template <typename Entry>
class SharedSequence {
 public:
  SharedSequence() : blocks_(std::make_shared<const std::vector<Block>>()) {}
  explicit SharedSequence(const std::vector<Entry>& entries) {
    std::vector<Block> blocks;
    append(blocks, entries);
    set(std::move(blocks));
  }

  std::size_t size() const { return size_; }
  const Entry& operator[](std::size_t index) const {
    const Block& block = *block_of(index);
    return (*block.entries)[index - block.first];
  }
  /// How many entries have a t below the given one.
  std::size_t count_below(double t) const {
    const auto after = std::partition_point(blocks_->begin(), blocks_->end(),
                                            [t](const Block& block) { return block.entries->front().t < t; });
    if (after == blocks_->begin()) return 0;
    const Block& block = after[-1];
    const auto& entries = *block.entries;
    const auto at =
        std::partition_point(entries.begin(), entries.end(), [t](const Entry& entry) { return entry.t < t; });
    return block.first + static_cast<std::size_t>(at - entries.begin());
  }
  /// Entries first .. last - 1 replaced by others.
  SharedSequence replaced(std::size_t first, std::size_t last, const std::vector<Entry>& by) const {
    std::vector<Block> blocks;
    blocks.reserve(blocks_->size() + by.size() / most + 2);
    std::vector<Entry> changed;
    auto block = blocks_->begin();
    // A block that is cut takes part whole, and one more where what is left would be short.
    for (; block != blocks_->end() && block->first + block->entries->size() <= first; ++block) blocks.push_back(*block);
    if (!blocks.empty() && (block == blocks_->end() || first - block->first < fewest)) {
      --block;
      blocks.pop_back();
    }
    if (block != blocks_->end()) {
      for (std::size_t i = block->first; i < first; ++i) changed.push_back((*this)[i]);
    }
    changed.insert(changed.end(), by.begin(), by.end());
    for (; block != blocks_->end(); ++block) {
      if (block->first >= last && (changed.empty() || changed.size() >= fewest)) break;
      const std::size_t from = std::max(last, block->first) - block->first;
      if (from < block->entries->size()) {
        changed.insert(changed.end(), block->entries->begin() + static_cast<std::ptrdiff_t>(from),
                       block->entries->end());
      }
    }
    append(blocks, changed);
    blocks.insert(blocks.end(), block, blocks_->end());
    SharedSequence result;
    result.set(std::move(blocks));
    return result;
  }
  /// Ranges [first, last) of entries whose boxes, each with the first entry after it, meet a box; in order, apart.
  std::vector<std::pair<std::size_t, std::size_t>> near(const Box& box) const {
    std::vector<std::pair<std::size_t, std::size_t>> ranges;
    const auto meets = [&box](const Box& other) {
      return (other.low.array() <= box.high.array()).all() && (box.low.array() <= other.high.array()).all();
    };
    for (std::size_t b = 0; b < blocks_->size(); ++b) {
      const Block& block = (*blocks_)[b];
      const Entry& following = (*blocks_)[b + 1 < blocks_->size() ? b + 1 : 0].entries->front();
      Box whole = block.box;
      following.add_to(whole);
      if (!meets(whole)) continue;
      for (std::size_t i = 0; i < block.entries->size(); ++i) {
        Box own;
        (*block.entries)[i].add_to(own);
        (i + 1 < block.entries->size() ? (*block.entries)[i + 1] : following).add_to(own);
        if (!meets(own)) continue;
        const std::size_t index = block.first + i;
        if (!ranges.empty() && ranges.back().second == index) {
          ++ranges.back().second;
        } else {
          ranges.emplace_back(index, index + 1);
        }
      }
    }
    return ranges;
  }
  /// Bytes held by this sequence that another does not hold too.
  std::size_t bytes_beyond(const SharedSequence& other) const {
    if (blocks_ == other.blocks_) return 0;
    std::size_t bytes = blocks_->size() * sizeof(Block);
    auto theirs = other.blocks_->begin();
    for (const Block& block : *blocks_) {
      const auto same =
          std::find_if(theirs, other.blocks_->end(), [&](const Block& b) { return b.entries == block.entries; });
      if (same != other.blocks_->end()) {
        theirs = same + 1;
      } else {
        bytes += block.entries->size() * sizeof(Entry);
      }
    }
    return bytes;
  }

 private:
  struct Block {
    std::shared_ptr<const std::vector<Entry>> entries;  // never empty
    Box box;
    std::size_t first = 0;
  };
  static constexpr std::size_t most = 32;
  static constexpr std::size_t fewest = 8;

  const Block* block_of(std::size_t index) const {
    const auto after = std::partition_point(blocks_->begin(), blocks_->end(),
                                            [index](const Block& block) { return block.first <= index; });
    return &after[-1];
  }
  static void append(std::vector<Block>& blocks, const std::vector<Entry>& entries) {
    const std::size_t parts = (entries.size() + most - 1) / most;
    for (std::size_t k = 0; k < parts; ++k) {
      const auto from = entries.begin() + static_cast<std::ptrdiff_t>(entries.size() * k / parts);
      const auto to = entries.begin() + static_cast<std::ptrdiff_t>(entries.size() * (k + 1) / parts);
      Block block;
      block.entries = std::make_shared<const std::vector<Entry>>(from, to);
      for (const Entry& entry : *block.entries) entry.add_to(block.box);
      blocks.push_back(std::move(block));
    }
  }
  void set(std::vector<Block> blocks) {
    size_ = 0;
    for (Block& block : blocks) {
      block.first = size_;
      size_ += block.entries->size();
    }
    blocks_ = std::make_shared<const std::vector<Block>>(std::move(blocks));
  }

  std::shared_ptr<const std::vector<Block>> blocks_;
  std::size_t size_ = 0;
};

}  // namespace fontcore
