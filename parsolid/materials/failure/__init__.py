"""When plastic flow ends in failure, one file a criterion; what failed matter still bears."""
