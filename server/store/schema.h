// The tables of the store and how an older file is brought up to them.
#pragma once
#include "server/store/sqlite.h"

namespace gonio {

// Applies what is missing, each step in a transaction of its own. Throws Error(io) for a file that a newer
// gonio wrote: reading it with half the columns known would be guessing.
void migrate(Database& database);

}  // namespace gonio
