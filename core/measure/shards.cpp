#include "measure/shards.h"

#include <algorithm>

namespace gonio {

std::string shard_key(int index) {
    return "shard-" + std::to_string(index);
}

MissingShards::MissingShards(std::vector<int> which) : indices_(std::move(which)) {
    text_ = "shards that are not there yet:";
    for (const int i : indices_) text_ += " " + std::to_string(i);
}

Shards::Batch Shards::take(int n) {
    Batch batch;
    batch.first = taken_;
    batch.saved.resize(n);
    taken_ += n;
    for (int k = 0; k < n; ++k) {
        if (checkpoints_) batch.saved[k] = checkpoints_->load(shard_key(batch.first + k));
        if (!batch.saved[k]) batch.to_compute.push_back(k);
    }
    if (task_.kind == ShardTask::Kind::compute_all) return batch;
    if (task_.kind == ShardTask::Kind::compute_one && task_.index >= batch.first && task_.index < taken_) {
        const int wanted = task_.index - batch.first;
        if (batch.saved[wanted]) throw ShardDone();
        batch.to_compute = {wanted};
    } else if (!batch.to_compute.empty()) {
        std::vector<int> missing = batch.to_compute;
        for (int& k : missing) k += batch.first;
        throw MissingShards(std::move(missing));
    }
    return batch;
}

void Shards::save(const Batch& batch, int position, const std::string& bytes) {
    if (checkpoints_) checkpoints_->save(shard_key(batch.first + position), bytes);
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
