"""The paper's measurements by the field model in time: what a relaxing film explains of them."""
