#include "measure/shards.h"

#include <algorithm>

namespace gonio {

MissingShards::MissingShards(std::vector<Shard> which) : shards_(std::move(which)) {
    text_ = "shards that are not there yet:";
    for (const Shard& shard : shards_) text_ += " " + std::to_string(shard.index);
}

Shards::Batch Shards::take(std::vector<std::string> keys) {
    const int n = static_cast<int>(keys.size());
    Batch batch;
    batch.first = taken_;
    batch.keys = std::move(keys);
    batch.saved.resize(n);
    taken_ += n;
    for (int k = 0; k < n; ++k) {
        if (checkpoints_) batch.saved[k] = checkpoints_->load(batch.keys[k]);
        if (!batch.saved[k]) batch.to_compute.push_back(k);
    }
    if (task_.kind == ShardTask::Kind::compute_all) return batch;
    if (task_.kind == ShardTask::Kind::compute_one && task_.index >= batch.first && task_.index < taken_) {
        const int wanted = task_.index - batch.first;
        if (batch.saved[wanted]) throw ShardDone();
        batch.to_compute = {wanted};
    } else if (!batch.to_compute.empty()) {
        std::vector<Shard> missing;
        for (const int k : batch.to_compute) missing.push_back({batch.first + k, batch.keys[k]});
        throw MissingShards(std::move(missing));
    }
    return batch;
}

void Shards::save(const Batch& batch, int position, const std::string& bytes) {
    if (checkpoints_) checkpoints_->save(batch.keys[position], bytes);
}

void Shards::finish(const Batch& batch) const {
    if (task_.kind == ShardTask::Kind::compute_one && task_.index >= batch.first &&
        task_.index < batch.first + static_cast<int>(batch.saved.size()))
        throw ShardDone();
}

std::string Shards::part(const std::string& key, const std::function<std::string()>& compute) {
    if (checkpoints_)
        if (std::optional<std::string> saved = checkpoints_->load(key)) return *saved;
    std::string bytes = compute();
    if (checkpoints_) checkpoints_->save(key, bytes);
    return bytes;
}

}  // namespace gonio
